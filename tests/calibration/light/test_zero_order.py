"""Blur and halo are found together with the columns of single pixels."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from dsl_core.calibration.light.zero_order import (
    _derivatives,
    _require_peaks,
    _window,
    fit_zero_order,
    require_plausible,
)
from dsl_core.errors import CalibrationError
from dsl_core.model.plan import ScanLines
from dsl_core.model.projector.line_spread import LineSpread
from dsl_core.model.rig import ProjectorResponse
from dsl_core.optics.lines.profile import zero_order_profile

LINES = ScanLines(width_px=5, step_px=2)
TRUTH = ProjectorResponse(blur_px=0.72, halo_peak_per_px=0.0012, halo_decay_px=26.0)
REACH_PX = 150.0
START = ProjectorResponse(blur_px=0.5, halo_peak_per_px=0.0, halo_decay_px=35.0)


def lines_seen(pixels: int, truth: ProjectorResponse) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """True columns, and radiance with its deviation, (318, pixels)."""
    rng = np.random.default_rng(0)
    column = rng.uniform(40.0, 600.0, pixels)
    centres = 2.0 + 2.0 * np.arange(318)[:, None]
    profile = zero_order_profile(torch.as_tensor(column - centres), -2.5, 2.5, truth).numpy()
    light = rng.uniform(5.0, 20.0, pixels) * profile + 0.01
    std = np.sqrt(2e-4 + 1e-4 * light)
    return column, light + std * rng.standard_normal(light.shape), std


def test_blur_halo_and_columns_are_found_from_decoded_columns() -> None:
    column, radiance, std = lines_seen(400, TRUTH)
    fit = fit_zero_order(LINES, np.round(column), radiance, std, START, REACH_PX)
    for found, truth, spread in zip(
        (fit.response.blur_px, fit.response.halo_peak_per_px, fit.response.halo_decay_px),
        (TRUTH.blur_px, TRUTH.halo_peak_per_px, TRUTH.halo_decay_px),
        fit.std,
        strict=True,
    ):
        assert abs(found / truth - 1) < 0.01
        assert abs(found - truth) < 4 * spread
    assert fit.good.mean() > 0.98
    assert np.sqrt(np.mean((fit.column_px - column)[fit.good] ** 2)) < 0.01


def test_a_measured_spread_keeps_its_shape_and_finds_its_width() -> None:
    places = np.arange(-32, 33) / 8
    skewed = LineSpread.of(np.exp(-0.5 * (places / np.where(places < 0, 0.4, 1.0)) ** 2), 0.125)
    truth = TRUTH.with_spread(skewed)
    column, radiance, std = lines_seen(400, truth)
    start = START.with_spread(skewed.stretched(0.85))
    fit = fit_zero_order(LINES, np.round(column), radiance, std, start, REACH_PX)
    assert fit.response.blur_px == pytest.approx(truth.blur_px, rel=0.01)
    assert fit.response.spread is not None
    assert fit.response.spread.lean_px == pytest.approx(skewed.lean_px, rel=0.01)
    assert fit.response.halo_peak_per_px == pytest.approx(truth.halo_peak_per_px, rel=0.03)
    assert np.sqrt(np.mean((fit.column_px - column)[fit.good] ** 2)) < 0.01


def test_pixels_that_see_a_second_light_are_left_out() -> None:
    column, radiance, std = lines_seen(400, TRUTH)
    second = np.arange(400) % 10 == 0
    radiance[:, second] += 0.3 * np.roll(radiance[:, second], 10, axis=0)
    fit = fit_zero_order(LINES, np.round(column), radiance, std, START, REACH_PX)
    assert not fit.good[second].any()
    assert fit.good[~second].mean() > 0.98
    assert fit.chi_square == pytest.approx(1.0, abs=0.1)
    assert fit.response.blur_px == pytest.approx(TRUTH.blur_px, rel=0.01)


def test_a_fit_that_ends_at_the_edge_of_what_is_plausible_is_refused() -> None:
    truth = TRUTH.model_copy(update={"halo_peak_per_px": 0.2, "halo_decay_px": 4.0})
    column, radiance, std = lines_seen(300, truth)
    with pytest.raises(CalibrationError, match=r"halo came out as 0\.1 of .* less than 0\.1 is plausible"):
        fit_zero_order(LINES, np.round(column), radiance, std, START, REACH_PX)
    require_plausible(0.06, 0.09)
    for blur_px in (0.05, 5.0):
        with pytest.raises(CalibrationError, match=rf"blur came out as {blur_px:g} px, .*0\.05 to 5 px"):
            require_plausible(blur_px, 0.0)


def test_no_halo_is_found_as_none() -> None:
    truth = TRUTH.model_copy(update={"halo_peak_per_px": 0.0})
    column, radiance, std = lines_seen(300, truth)
    fit = fit_zero_order(LINES, np.round(column), radiance, std, START, REACH_PX)
    assert fit.response.halo_peak_per_px < 4 * fit.std[1] + 1e-6


def test_noise_without_lines_is_refused() -> None:
    rng = np.random.default_rng(0)
    noise = 0.1 * rng.standard_normal((318, 200))
    with pytest.raises(CalibrationError, match="lines are resolved in only"):
        fit_zero_order(LINES, np.full(200, 300.0), noise, np.full(noise.shape, 0.1), START, REACH_PX)


def test_deviations_are_those_of_all_pixels_with_their_own_unknowns() -> None:
    """Of blur, halo and its decay, whose logarithm is fitted and known to a factor of two beforehand."""
    column, radiance, std = lines_seen(120, TRUTH)
    fit = fit_zero_order(LINES, np.round(column), radiance, std, START, REACH_PX)
    data = _window(LINES, np.round(column), radiance, std, REACH_PX)
    found = fit.response
    common = np.array([found.blur_px, found.halo_peak_per_px, np.log(found.halo_decay_px)])
    value, by_column, by_common = _derivatives(data, fit.column_px, START, common)
    near = np.abs(fit.column_px - data.centres) < 8.0
    root = (data.variance + near * (0.002 * fit.amplitude) ** 2) ** -0.5
    total = np.diag([0.0, 0.0, 0.7**-2])
    for p in np.flatnonzero(fit.good):
        own = np.stack([value[:, p], by_column[:, p], np.ones(len(value))], 1) * root[:, [p]]
        shared = fit.amplitude[p] * by_common[:, :, p].T * root[:, [p]]
        shared = shared - own @ np.linalg.lstsq(own, shared)[0]
        total += shared.T @ shared
    wanted = np.sqrt(np.diag(np.linalg.inv(total))) * [1.0, 1.0, found.halo_decay_px]
    assert fit.chi_square == pytest.approx(1.0, abs=0.1)
    assert fit.std == pytest.approx(wanted, rel=0.06)


def test_a_window_holds_the_lines_in_reach_and_nothing_of_those_that_are_not_there() -> None:
    radiance = np.arange(60.0).reshape(20, 3)
    std = np.full((20, 3), 0.5)
    std[10, 1], radiance[9, 1] = np.inf, np.nan
    # Lines five columns wide and two apart: the first is at column 2, and 20 at column 42.
    data = _window(LINES, np.array([2.4, 20.9, 42.0]), radiance, std, 9.0)
    assert data.centres[:, 0].tolist() == [-6.0, -4.0, -2.0, 0.0, 2.0, 4.0, 6.0, 8.0, 10.0]
    assert data.y[:, 0].tolist() == [0, 0, 0, 0, 0, 3, 6, 9, 12]
    assert np.isfinite(data.variance[:, 0]).tolist() == [False] * 4 + [True] * 5
    assert data.centres[4, 1:].tolist() == [20.0, 42.0]
    assert np.flatnonzero(~np.isfinite(data.variance[:, 1])).tolist() == [4, 5]
    assert data.y[4:6, 1].tolist() == [0.0, 0.0]
    assert np.isfinite(data.variance[:, 2]).tolist() == [True] * 4 + [False] * 5
    assert data.variance[0, 2] == 0.25
    assert len(_window(LINES, np.array([20.0]), radiance[:, :1], std[:, :1], 1.0).y) == 9, (
        "at least what is near"
    )


@pytest.mark.parametrize(("count", "enough"), [(100, True), (99, False)])
def test_a_hundred_pixels_have_to_show_lines(count: int, enough: bool) -> None:
    use = np.arange(300) < count
    if enough:
        _require_peaks(use)
    else:
        with pytest.raises(CalibrationError, match="resolved in only 99 of 300 pixels"):
            _require_peaks(use)


def test_pixels_that_end_two_columns_away_or_fit_five_times_worse_are_not_good() -> None:
    column, radiance, std = lines_seen(300, TRUTH)
    coarse = column.copy()
    coarse[:10] += 1.9
    coarse[10:20] += 2.1
    # Noise beyond what is stated: of half of all by a factor of two, which says nothing, of some of four.
    std[:, 20:40] /= 2.6
    fit = fit_zero_order(LINES, coarse, radiance, std, START, REACH_PX)
    assert fit.good[:10].all()
    assert not fit.good[10:20].any()
    assert fit.good[20:40].mean() < 0.2
    assert fit.good[40:].mean() > 0.98
