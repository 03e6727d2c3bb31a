"""Planes are judged in columns, whatever a column is in millimetres at their distance."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from dsl_core.calibration.film.depth_stage import StageData, _positions
from dsl_core.campaign.depth_stage.figures import CURVES_ADVICE, depth_stage_figures
from dsl_core.campaign.depth_stage.recipe import StageNote, _filter_of
from dsl_core.model.calibration.chain import ChainCorrection
from dsl_core.model.calibration.depth_stage import DepthStageCalibration, HeldOutError, StagePosition
from dsl_core.model.figure import Figure
from dsl_core.model.spectral import SpectralCurve
from dsl_core.optics.filters import nominal_filter
from dsl_core.optics.shading import Plane
from dsl_core.simulation.published_rig import published_rig

RIG = published_rig()
#: Millimetres a column at 600 and 900 mm.
MM_PER_PX = {600.0: 6.5, 900.0: 14.6}
FILM_STD = dict.fromkeys(
    ("lines_per_mm", "distance_mm", "tilt_x_deg", "tilt_y_deg", "roll_deg", "bend_per_mm"), 0.1
)


def figure_of(
    name: str,
    rms_px: dict[float, float],
    limit_px: float,
    chain: ChainCorrection | None,
    indices: tuple[tuple[float, float], tuple[float, float]] | None = None,
) -> Figure:
    """A figure of planes whose columns scatter by so much at each position.

    ``indices`` are the filters' index now and before, each with its deviation.
    """
    positions = tuple(
        StagePosition(
            position_mm=mm,
            tilt_deg=0.1,
            distance_mm=mm,
            plane_rms_mm=px * MM_PER_PX[mm],
            column_rms_px=px,
            column_limit_px=limit_px,
            step_error_mm=0.0,
            step_std_mm=0.01,
        )
        for mm, px in rms_px.items()
    )
    record = record_of_positions(positions, chain, indices)
    return next(each for each in depth_stage_figures(record) if each.name == name)


def record_of_positions(
    positions: tuple[StagePosition, ...],
    chain: ChainCorrection | None = None,
    indices: tuple[tuple[float, float], tuple[float, float]] | None = None,
) -> DepthStageCalibration:
    """A record of these positions, of which the rest is as it should be."""
    return DepthStageCalibration.model_construct(
        positions=positions,
        film=RIG.film,
        film_std=FILM_STD,
        geometry_pull=1.0,
        bow_mm=None,
        depth_std_mm=0.1,
        held_out=(HeldOutError(kept_out="x", grating_px=0.1, hybrid_px=0.1, noise_px=0.1),),
        chain=chain,
        filter_index=None if indices is None else indices[0],
        filter_index_before=None if indices is None else indices[1],
        warnings=(),
    )


def plane_figure(rms_px: dict[float, float], limit_px: float = 0.04) -> Figure:
    """The figure of the planes themselves."""
    return figure_of("residual about the plane, rms", rms_px, limit_px, None)


def test_the_same_error_of_columns_passes_at_every_distance() -> None:
    # .026 px are .38 mm at 900 mm: what a rig with another line profile leaves.
    figure = plane_figure({600.0: 0.026, 900.0: 0.026})
    assert figure.passed
    assert plane_figure({600.0: 0.02, 900.0: 0.026}).value == pytest.approx(0.38, abs=0.005)
    assert figure.high == pytest.approx(0.04 * MM_PER_PX[600.0])


def test_steps_may_be_off_by_what_positions_are_stated_to() -> None:
    """A ruler that is read to half a millimetre is no broken stage."""
    never: Any = None
    for std_mm, limit_mm in ((0.02, 0.1), (0.5, 1.5)):
        data = StageData((600.0, 800.0), std_mm, (), (), lambda position, name: never, 2)
        both = np.full(2, 0.01)
        planes: Any = SimpleNamespace(
            planes=[Plane(np.array([0.0, 0.0, 1 / 600])), Plane(np.array([0.0, 0.0, 1 / 800]))],
            plane_rms_mm=both,
            residual_rms_px=both,
            limit_px=both,
            step_error_mm=np.array([0.54, -0.54]),
            step_std_mm=both,
        )
        record = record_of_positions(_positions(data, planes))
        figure = next(f for f in depth_stage_figures(record) if f.name == "error of the stage's steps")
        assert figure.high == pytest.approx(limit_mm)
        assert figure.passed == (limit_mm > 0.54)
        assert "stage_std_mm" in figure.advice


def test_planes_that_all_scatter_do_not_put_the_blame_on_the_target() -> None:
    figure = plane_figure({600.0: 0.06, 900.0: 0.07})
    assert not figure.passed
    assert "0.070 px, worst at 900 mm, alike at all positions" in figure.advice
    assert figure.advice.index("line profile") < figure.advice.index("target is not flat")


def test_a_plane_that_is_worse_than_all_others_is_named() -> None:
    figure = plane_figure({600.0: 0.09, 900.0: 0.01})
    assert not figure.passed
    assert "worst at 600 mm and much less elsewhere: check the target there" in figure.advice


def chain_figure(plus: float, minus: float) -> Figure:
    """The figure of a chain that is 60 % off, with factors of both first orders."""
    flat = SpectralCurve.of([400.0, 700.0], [1.0, 1.0])
    chain = ChainCorrection(
        efficiency_factors={
            order: SpectralCurve.of([400.0, 700.0], [factor] * 2)
            for order, factor in ((1, plus), (-1, minus))
        },
        response_factors=(flat, flat, flat),
        white_scale_factor=1.0,
        white_scale_rel_std=0.001,
        chain_rel_std=flat,
        largest_correction=0.6,
        pixels=100,
        chi_square=1.0,
    )
    figure = figure_of(
        "largest correction of response, emission and efficiency", {600.0: 0.01, 900.0: 0.01}, 0.04, chain
    )
    assert not figure.passed
    return figure


def test_a_film_that_was_turned_over_since_the_filters_is_named_with_both_orders() -> None:
    advice = chain_figure(0.71, 1.39).advice
    assert "order +1 29% darker and order -1 39% brighter: the film was probably turned over" in advice
    assert "order +1 40% brighter and order -1 29% darker" in chain_figure(1.4, 0.71).advice


@pytest.mark.parametrize(("plus", "minus"), [(1.6, 1.6), (1.6, 1.0), (0.95, 1.05), (0.6, 0.8)])
def test_orders_that_do_not_change_by_opposite_shares_blame_no_film(plus: float, minus: float) -> None:
    assert chain_figure(plus, minus).advice == CURVES_ADVICE
    assert "new campaign without the Color Checker" in CURVES_ADVICE


@pytest.mark.parametrize(
    ("now", "before", "passed"),
    [
        ((1.70, 0.01), (1.65, 0.01), True),
        ((1.70, 0.01), (1.55, 0.01), False),
        ((1.50, 0.01), (1.65, 0.01), False),
        ((1.70, 0.04), (1.55, 0.04), True),
    ],
)
def test_filters_that_shift_otherwise_than_before_are_told(
    now: tuple[float, float], before: tuple[float, float], passed: bool
) -> None:
    name = "refractive index of the filters, change since the bandpass filters"
    figure = figure_of(name, {600.0: 0.01, 900.0: 0.01}, 0.04, None, (now, before))
    assert figure.value == pytest.approx(now[0] - before[0])
    assert figure.passed is passed


@pytest.mark.parametrize("measured", [False, True])
def test_filters_that_nobody_measured_are_as_wide_as_stated(measured: bool) -> None:
    curve = nominal_filter(450.0)
    note = StageNote(position_mm=700.0, filter_nm=450.0, transmission=curve, measured=measured)
    assert _filter_of(note, 20.0).transmission == (curve if measured else nominal_filter(450.0, 20.0))
