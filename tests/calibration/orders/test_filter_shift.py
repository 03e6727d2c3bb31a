"""The shift of filters with the angle of view follows from the zero order in cells of the image."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.calibration.orders.filter_shift import angle_of_view, cell_terms
from dsl_core.calibration.orders.order_light import FilterLight
from dsl_core.calibration.orders.order_place import PlanePixels
from dsl_core.optics.filters import FINE_NM, FilterAngle, nominal_filter, relative_shift, shift_terms
from dsl_core.optics.spectra import chain_response
from dsl_core.simulation.published_rig import published_rig

RIG = published_rig()
RIG = RIG.model_copy(update={"camera": RIG.camera.resized(112, 72)})
NOISE = 2e-3


def pixels() -> tuple[PlanePixels, np.ndarray]:
    """All pixels of the image, and their flat indices."""
    index = np.arange(112 * 72)
    rows, columns = np.divmod(index, 112)
    place = np.stack([(rows + 0.5) / 72, (columns + 0.5) / 112])
    ones = np.ones(len(index))
    return PlanePixels(ones, ones, index % 3, place, {}), index


TERMS = cell_terms(RIG, *pixels())


def found(
    centres: tuple[float, ...],
    index: float = np.inf,
    tilt_deg: float = 0.0,
    stated: tuple[float, float] = (NOISE, NOISE),
) -> FilterAngle:
    """What filters of an index say whose cells are seen at the exact angle, by the usual formula.

    White is darker towards one corner, and so is each filter; ``stated`` are the deviations of filters and
    white.
    """
    rng = np.random.default_rng(3)
    uneven = 1 - 0.3 * np.linspace(0, 1, 24)
    x, y = TERMS[:, 1], TERMS[:, 2]
    tilt = np.radians(tilt_deg)
    cosine = np.sin(tilt) * x + np.cos(tilt) * np.sqrt(1 - x**2 - y**2)
    ratio = np.sqrt(1 - (1 - cosine**2) / index**2)
    white = chain_response(RIG, 0, FINE_NM).sum(1)
    lights = []
    for nm in centres:
        through = np.stack([np.interp(FINE_NM / r, *bands(nm), 0.0, 0.0) for r in ratio])
        cells = 0.7 * (white @ through.T) * uneven * (1 + NOISE * rng.standard_normal((3, 24)))
        zero = cells.mean(1)
        lights.append(FilterLight(zero, NOISE * zero, {}, (0.0, 0.0), 0.0, cells, stated[0] * cells))
    bright = np.ones((3, 24)) * uneven
    curves, white_seen = [nominal_filter(nm) for nm in centres], (bright, stated[1] * bright)
    return angle_of_view(RIG, curves, lights, white_seen, TERMS)


def bands(centre_nm: float) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Wavelengths and transmissions of a filter."""
    curve = nominal_filter(centre_nm)
    return curve.wavelengths_nm, curve.values


@pytest.mark.parametrize(("index", "tilt_deg"), [(1.9, 3.0), (1.5, -2.0), (2.2, 0.0)])
def test_index_and_tilt_follow_from_how_dark_the_sides_are(index: float, tilt_deg: float) -> None:
    angle = found((450.0, 480.0, 540.0, 590.0, 640.0), index, tilt_deg)
    assert angle.index is not None
    assert angle.index[0] == pytest.approx(index, rel=0.03)
    assert abs(angle.index[0] - index) < 3 * angle.index[1]
    assert angle.values[1] == pytest.approx(np.sin(np.radians(tilt_deg)) / index**2, abs=1e-3)
    shift = relative_shift(TERMS, np.array(angle.values))
    assert 550 * shift.min() < -1.5, "nm at the side"


def test_filters_that_do_not_shift_are_left_alone() -> None:
    angle = found((450.0, 480.0, 540.0, 590.0, 640.0))
    assert angle.index is None
    assert abs(angle.values[0]) < 4 * angle.std[0]
    assert angle.std[0] < 0.01


@pytest.mark.parametrize("stated", [(5 * NOISE, NOISE), (NOISE, 5 * NOISE)])
def test_an_unsure_filter_and_an_unsure_white_make_the_angle_unsure(stated: tuple[float, float]) -> None:
    centres = (450.0, 480.0, 540.0, 590.0, 640.0)
    assert found(centres, stated=stated).std[0] > 2 * found(centres).std[0]


def test_filters_that_show_nothing_leave_what_was_assumed() -> None:
    dark = FilterLight(np.full(3, np.nan), np.full(3, np.inf), {}, (0.0, 0.0), 0.0)
    white = np.ones((3, 24)), np.full((3, 24), 0.01)
    angle = angle_of_view(RIG, [nominal_filter(550.0)], [dark], white, TERMS)
    assert angle.values == (0.0, 0.0, 0.0)
    assert not angle.is_of_filters


def test_a_cell_has_the_mean_of_its_pixels_and_an_empty_one_has_nothing() -> None:
    every, index = pixels()
    some = every.at(every.cell != 7)
    terms = cell_terms(RIG, some, index[every.cell != 7])
    assert terms.shape == (24, 3)
    assert terms[7].tolist() == [0.0, 0.0, 0.0]
    assert terms[5] == pytest.approx(shift_terms(RIG, index[every.cell == 5]).mean(0))
