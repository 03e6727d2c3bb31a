"""The equations of the line scan of a diffuser: their places, slopes and selections."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.calibration.light.chain_equations import (
    BANDS_NM,
    STEP_NM,
    LineScan,
    Unknowns,
    colours_of,
    steepness,
    stretched,
    without_outliers,
    zero_order_equations,
    zero_order_ratios,
    zero_order_signals,
)
from dsl_core.model.plan import ScanLines
from dsl_core.model.spectral import SpectralCurve
from dsl_core.optics.spectra import hat_moments
from dsl_core.simulation.published_rig import published_rig

RIG = published_rig()
WHITE = SpectralCurve.of([550.0], [0.99])
UNKNOWNS = Unknowns(np.arange(400.0, 701.0, 50.0))


def scan(pixels: int = 300) -> LineScan:
    """Zero orders as the rig expects them, with a noise of a thousandth; frames hold their numbers."""
    rng = np.random.default_rng(0)
    lines = LineScan(
        ScanLines(width_px=5, step_px=5),
        rng.choice(RIG.camera.width_px * RIG.camera.height_px, pixels, replace=False),
        np.full(pixels, 700.0),
        rng.uniform(0.5, 1.0, pixels),
        rng.uniform(50.0, 590.0, pixels),
        np.ones(pixels),
        np.zeros(pixels),
        np.arange(128.0)[:, None] * np.ones(pixels),
        np.ones((128, pixels)),
    )
    expected = zero_order_signals(RIG, WHITE).sum(-1)[colours_of(RIG, lines)] * lines.shading
    amplitude = expected * (1 + 1e-3 * rng.standard_normal(pixels))
    return LineScan(**{**vars(lines), "amplitude": amplitude})


def test_frames_between_two_columns_are_those_whose_lines_touch_them() -> None:
    part = scan().between(100.0, 130.0)
    near = np.flatnonzero(np.abs(2 + 5 * np.arange(128) - 115) < 15 + 2.5 + 6)
    assert part.radiance[:, 0].tolist() == near.tolist()
    assert part.first_line == near[0]
    assert part.centres_px.tolist() == (2.0 + 5.0 * near).tolist()
    # Frames are counted from the first that is left, so that parts of parts keep their lines.
    assert part.between(115.0, 116.0).centres_px.min() > 100
    assert len(part.between(400.0, 420.0).radiance) == 0


def test_every_unknown_has_a_place_of_its_own() -> None:
    places = np.zeros(UNKNOWNS.count + 1, int)
    for block in (*(UNKNOWNS.efficiency(m) for m in (1, -1)), *(UNKNOWNS.response(c) for c in range(3))):
        places[block] += 1
    places[UNKNOWNS.white] += 1
    places[UNKNOWNS.scale] += 1
    assert places.tolist() == [1] * len(places)


def test_pixels_with_another_zero_order_than_their_colour_are_left_out() -> None:
    seen = scan()
    assert zero_order_ratios(RIG, seen, WHITE) == pytest.approx(1.0, abs=5e-3)
    amplitude = seen.amplitude.copy()
    amplitude[:20] *= 1.02
    amplitude[20] = np.nan
    kept = without_outliers(RIG, LineScan(**{**vars(seen), "amplitude": amplitude}), WHITE)
    assert set(kept.pixels) == set(seen.pixels[21:])


def test_a_brighter_zero_order_is_explained_by_white_scale_or_by_the_colours_response() -> None:
    ratio = np.array([1.02, 1.02, 1.02])
    equations = zero_order_equations(RIG, ratio, np.full(3, 1e-3), WHITE, UNKNOWNS)
    scale = np.zeros(UNKNOWNS.count + 1)
    scale[UNKNOWNS.white] = 0.02
    response = np.zeros(UNKNOWNS.count + 1)
    for colour in range(3):
        response[UNKNOWNS.response(colour)] = 0.02
    for x in (scale, response):
        misfit = equations.square - 2 * x @ equations.right + x @ equations.normal @ x
        assert misfit == pytest.approx(0.0, abs=1e-6)
    assert equations.count == 3


def test_steepness_is_the_slope_of_light_by_the_wavelength_of_the_emission() -> None:
    slope = steepness(RIG, 1, BANDS_NM, STEP_NM)
    shorter, light, longer = (
        hat_moments(stretched(RIG, factor), 1, BANDS_NM, STEP_NM)[0].sum(1)
        for factor in (1 - 1e-4, 1.0, 1 + 1e-4)
    )
    lit = light > 0.05 * light.max()
    # Light of a longer wavelength than taken for: the emission as it would be at shorter ones.
    assert slope[lit] == pytest.approx(((shorter - longer) / 2e-4)[lit] / light[lit], rel=0.05, abs=0.3)
    assert np.abs(slope[lit]).max() > 5
    assert stretched(RIG, 1.01).emission[0].wavelengths_nm[0] == 1.01 * RIG.emission[0].wavelengths_nm[0]


def test_no_frame_is_between_columns_beyond_the_last_line() -> None:
    part = scan().between(900.0, 950.0)
    assert (len(part.radiance), part.first_line) == (0, 0)
