"""The evidence of a depth stage: planes, film, first orders never seen, and columns over depth."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pyqtgraph as pg
import pytest
from dsl_app.calibrate.evidence import depth_stage as depth_stage_evidence
from dsl_app.shared.theme import Theme
from pytestqt.qtbot import QtBot

from dsl_core.calibration.film.depth_stage import stage_curves
from dsl_core.campaign.session import CalibrationSession
from dsl_core.model.calibration.depth_stage import (
    DepthStageCalibration,
    FilterSeen,
    HeldOutError,
    StagePosition,
)
from dsl_core.model.rig import ColumnResidual, CorrespondenceGrid
from dsl_core.optics.pinhole import project, rays_at
from dsl_core.simulation.published_rig import published_rig
from tests.app.calibrate.evidence_bench import THEMES, bars, items, points, row_texts, shown

RIG = published_rig()
#: alpha, beta, gamma of both orders, the same at every node and wavelength.
LAWS = {1: (-120.0, -1.0, 700.0), -1: (-110.0, -1.0, 300.0)}


def grid() -> CorrespondenceGrid:
    laws = np.array([LAWS[1], LAWS[-1]])
    return CorrespondenceGrid(
        orders=(1, -1),
        wavelengths_nm=(450.0, 650.0),
        rows_px=(100.0, 290.0, 500.0),
        columns_px=(100.0, 444.0, 800.0),
        depth_range_mm=(600.0, 900.0),
        coefficients=tuple(np.broadcast_to(laws[:, None, None, None], (2, 2, 3, 3, 3)).ravel().tolist()),
    )


def position(mm: float, step_mm: float) -> StagePosition:
    return StagePosition(
        position_mm=mm,
        tilt_deg=0.1,
        distance_mm=mm,
        plane_rms_mm=mm / 10_000,
        column_rms_px=mm / 100_000,
        step_error_mm=step_mm,
        step_std_mm=0.01,
    )


def calibration(**changes: Any) -> DepthStageCalibration:
    made = DepthStageCalibration(
        camera=RIG.camera,
        projector=RIG.projector,
        pose=RIG.pose,
        column_std_px=0.01,
        depth_std_mm=0.047,
        geometry_pull=0.8,
        positions=(position(600.0, 0.01), position(900.0, -0.12)),
        film=RIG.film.model_copy(update={"lines_per_mm": 498.5}),
        film_std={name: 0.02 for _, name, _, _ in depth_stage_evidence.FILM},
        scatter_px=0.03,
        filters=(
            FilterSeen(filter_nm=450, effective_nm=450, measured=True, shift_px=(0.1, -0.2), tiles=900),
            FilterSeen(filter_nm=550, effective_nm=551, measured=True, shift_px=(0.0, 0.05), tiles=800),
        ),
        residual=ColumnResidual(
            orders=(1, -1),
            column_range_px=(0, 889),
            row_range_px=(0, 579),
            depth_range_mm=(600, 900),
            wavelength_range_nm=(430, 660),
            coefficients_px=((), ()),
        ),
        held_out=(
            HeldOutError(kept_out="position 600 mm", grating_px=0.4, hybrid_px=0.2, noise_px=0.1),
            HeldOutError(kept_out="filter 450 nm", grating_px=0.3, hybrid_px=0.25, noise_px=0.1),
            HeldOutError(kept_out="a third of the tiles", grating_px=0.2, hybrid_px=0.1, noise_px=0.1),
        ),
        correspondence=grid(),
        frames=100,
        warnings=("Through the filter of 450 nm first orders lie -0.20 px off at 900 mm",),
    )
    return made.model_copy(update=changes)


SESSION = cast(CalibrationSession, SimpleNamespace(bench=SimpleNamespace(rig=RIG)))


@pytest.mark.parametrize("theme", THEMES)
def test_planes_film_and_held_out_errors_are_shown(qtbot: QtBot, theme: Theme) -> None:
    widget = shown(qtbot, "depth-stage", calibration(), SESSION, theme)
    assert bars(widget.planes) == [pytest.approx([0.006, 0.009])]
    assert np.allclose(points(widget.steps)[0], [(600, 0.01), (900, -0.12)])
    assert row_texts(widget.film, 0) == ["Lines", "480.00", "498.50", "± 0.02", "1/mm"]
    assert bars(widget.held_out) == [
        pytest.approx([0.4, 0.3, 0.2]),
        pytest.approx([0.2, 0.25, 0.1]),
        pytest.approx([0.1, 0.1, 0.1]),
    ]
    assert "no&nbsp;residual&nbsp;was&nbsp;needed" in widget.held_out.legend.text()
    assert np.allclose(points(widget.shifts)[0], [(600, 0.1), (900, -0.2)])
    assert widget.warnings.text().startswith("Through the filter of 450 nm")
    qtbot.waitUntil(lambda: not widget._reader.is_busy, timeout=20_000)


def test_columns_over_depth_are_those_of_the_models(qtbot: QtBot) -> None:
    widget = shown(qtbot, "depth-stage", calibration(), SESSION)
    assert widget.curve.sentence.text() == "Computing the columns…"
    qtbot.waitUntil(lambda: len(points(widget.curve)) == 4, timeout=20_000)
    curves = {(each.order, each.filter_nm): each for each in stage_curves(calibration(), RIG)}
    blue = curves[1, 450.0]
    assert blue.grid_px is not None
    assert np.allclose(blue.grid_px, LAWS[1][0] / (blue.depth_mm / 1000) + LAWS[1][2])
    assert np.allclose(blue.seen_px - blue.seen_film_px, (0.1, -0.2))
    assert np.allclose(curves[-1, 450.0].shift_px, (-0.1, 0.2))
    drawn = [item.getData()[1] for item in items(widget.curve, pg.PlotCurveItem)]
    assert any(np.array_equal(values, blue.film_px) for values in drawn)
    off = [item.getData()[1] for item in items(widget.difference, pg.PlotCurveItem)]
    assert any(np.allclose(values, blue.grid_px - blue.film_px) for values in off)
    # First orders lie about evenly to both sides of the zero order.
    rays = rays_at(RIG.camera, np.array([444.0]), np.array([290.0])) * 600.0
    zero = project(RIG.projector, *(RIG.pose.matrix @ rays + RIG.pose.vector_mm[:, None]))[0][0]
    away = [abs(curves[order, 450.0].film_px[0] - zero) for order in (1, -1)]
    assert away == pytest.approx([220, 220], abs=15)


def test_light_from_beside_the_frame_is_not_drawn() -> None:
    far = FilterSeen(filter_nm=900, effective_nm=900, measured=True, shift_px=(0.0, 0.0), tiles=1)
    (right, left) = stage_curves(calibration(filters=(far,)), RIG)
    assert np.isnan(right.film_px).all()
    assert right.grid_px is not None
    assert np.isnan(right.grid_px).all()
    assert np.isnan(right.seen_px).all()
    assert left.order == -1


def test_without_a_grid_the_film_alone_is_drawn(qtbot: QtBot) -> None:
    widget = shown(qtbot, "depth-stage", calibration(correspondence=None, warnings=()), SESSION)
    qtbot.waitUntil(lambda: len(points(widget.curve)) == 4, timeout=20_000)
    assert items(widget.difference, pg.PlotCurveItem) == []
    assert "no&nbsp;data-driven&nbsp;curve" in widget.difference.legend.text()
    assert not widget.warnings.isVisible()
