"""Blur and halo are found together with the columns of single pixels."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from dsl_core.calibration.light.zero_order import fit_zero_order, require_plausible
from dsl_core.errors import CalibrationError
from dsl_core.model.plan import ScanLines
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
