"""A measured line spread against closed forms and brute force."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from dsl_core.model.projector.line_spread import LineSpread
from dsl_core.model.rig import ProjectorResponse
from dsl_core.optics.lines.profile import LineTable, ProfileTable, band_profile, step_edge, zero_order_profile
from dsl_core.optics.spread.curves import (
    BEYOND,
    EvenTable,
    density,
    mixed,
    reach_px,
    step_response,
    step_table,
)

STEP_PX, BLUR_PX = 0.125, 0.6
PLACES = np.arange(-48, 49) * STEP_PX
X = np.linspace(-9.0, 9.0, 1801)
#: The Gaussian of `BLUR_PX` as a sum of narrow ones.
GAUSSIAN = LineSpread.of(np.exp(-0.5 * PLACES**2 / (BLUR_PX**2 - STEP_PX**2)), STEP_PX)
SKEWED = LineSpread.of(np.where(PLACES >= 0, np.exp(-PLACES / BLUR_PX), 0.0), STEP_PX)


def test_a_measured_gaussian_is_the_closed_form() -> None:
    assert step_response(GAUSSIAN, X) == pytest.approx(step_response(BLUR_PX, X), abs=1e-5)
    assert density(GAUSSIAN, X) == pytest.approx(density(BLUR_PX, X), abs=1e-4)
    assert band_profile(X, 5.0, GAUSSIAN, 2.4) == pytest.approx(band_profile(X, 5.0, BLUR_PX, 2.4), abs=1e-5)
    closed = step_edge(torch.as_tensor(X), BLUR_PX)
    assert (step_edge(torch.as_tensor(X), GAUSSIAN) - closed).abs().max() < 1e-5


@pytest.mark.parametrize("spread", [GAUSSIAN, SKEWED, SKEWED.blurred(0.3)])
def test_density_step_and_band_belong_together(spread: LineSpread) -> None:
    fine = np.linspace(-12, 12, 24001)
    light = density(spread, fine)
    running = np.concatenate([[0.0], np.cumsum((light[1:] + light[:-1]) / 2)]) * 1e-3
    assert step_response(spread, X) == pytest.approx(np.interp(X, fine, running), abs=2e-5)
    triangle = np.clip(1 - np.abs(fine) / 2.4, 0, None) / 2.4
    line = step_response(spread, fine + 2.5) - step_response(spread, fine - 2.5)
    band = np.convolve(line, triangle, "same") * 1e-3
    assert band_profile(X, 5.0, spread, 2.4) == pytest.approx(np.interp(X, fine, band), abs=1e-4)


def test_the_reach_leaves_the_stated_share_outside() -> None:
    assert step_response(SKEWED, np.array([reach_px(SKEWED)])) == pytest.approx(1 - BEYOND, abs=1e-4)
    assert reach_px(GAUSSIAN) == pytest.approx(2.512 * BLUR_PX, abs=0.01)
    mirrored = LineSpread.of(np.where(PLACES <= 0, np.exp(PLACES / BLUR_PX), 0.0), STEP_PX)
    assert reach_px(mirrored) == pytest.approx(reach_px(SKEWED), abs=0.01)
    # A band's table is long enough for a curve with tails.
    table = ProfileTable(5.0, SKEWED, 2.4, torch.device("cpu"), torch.float64)
    assert table.support_px >= 2.5 + 2.4 + reach_px(SKEWED)


@pytest.mark.parametrize("spread", [None, SKEWED])
def test_the_table_of_a_line_is_its_profile_and_slope(spread: LineSpread | None) -> None:
    response = ProjectorResponse(blur_px=BLUR_PX, halo_peak_per_px=1e-3, halo_decay_px=20.0)
    response = response if spread is None else response.with_spread(spread)
    x = torch.as_tensor(X)
    profile, slope = LineTable(5, response, 9.0, x).at(x)
    exact = zero_order_profile(x, -2.5, 2.5, response)
    assert (profile - exact).abs().max() < 1e-5
    h = 1e-3
    around = [zero_order_profile(x + by, -2.5, 2.5, response) for by in (h, -h)]
    assert (slope - (around[0] - around[1]) / (2 * h)).abs().max() < 5e-3


def test_a_table_is_constant_beyond_its_ends_and_bears_what_is_no_number() -> None:
    table = EvenTable(-1.0, 0.5, [np.array([4.0, 2.0, 0.0, 6.0])], torch.zeros(1))
    found = table.at(torch.tensor([-7.0, -0.75, 0.25, 99.0, torch.nan]))[0]
    assert found[:4].tolist() == pytest.approx([4.0, 3.0, 3.0, 6.0], abs=0.01)
    assert torch.isfinite(found).all()


def test_slope_beside_a_line_is_that_of_its_halo_alone() -> None:
    response = ProjectorResponse(blur_px=BLUR_PX, halo_peak_per_px=1e-3, halo_decay_px=20.0)
    x = np.array([-9.0, -7.5, -6.0, 6.0, 7.5, 9.0])
    _, slope = LineTable(5, response, 9.0, torch.as_tensor(x)).at(torch.as_tensor(x))
    far, near = np.abs(x) + 2.5, np.abs(x) - 2.5
    wanted = np.sign(x) * 1e-3 * (np.exp(-far / 20) - np.exp(-near / 20))
    assert slope.numpy() == pytest.approx(wanted, rel=1e-3)


@pytest.mark.parametrize("spread", [BLUR_PX, SKEWED])
def test_a_table_of_steps_is_the_light_up_to_a_distance_and_its_slope(spread: float | LineSpread) -> None:
    x = torch.as_tensor(X)
    light, slope = step_table(spread, x).at(x)
    assert light.numpy() == pytest.approx(step_response(spread, X), abs=1e-5)
    assert slope.numpy() == pytest.approx(density(spread, X), abs=2e-3)


def test_a_mixture_is_the_sum_of_what_each_gaussian_does_at_its_own_place() -> None:
    spread = LineSpread(first_px=-0.25, step_px=0.25, core_px=0.1, shares=(0.2, 0.6, 0.2))

    def of_one(x: np.ndarray) -> np.ndarray:
        return np.asarray(np.exp(-(x**2)) + np.clip(x, -1, 1))

    at, found = mixed(spread, 1.5, of_one)
    wanted = sum(
        share * of_one(at - place) for place, share in zip((-0.25, 0, 0.25), spread.shares, strict=True)
    )
    assert found == pytest.approx(wanted)
    # As far as the function reaches beyond the outermost Gaussians, 256 samples a column.
    assert (at[0], at[-1]) == pytest.approx((-1.75, 1.75))
    assert len(at) == 2 * 1.75 * 256 + 1
    finer = LineSpread(first_px=-0.13, step_px=0.13, core_px=0.1, shares=(0.25, 0.5, 0.25))
    at, _ = mixed(finer, 1.0, of_one)
    assert at[1] - at[0] == pytest.approx(0.13 / 34)


def test_a_table_looks_up_every_curve_between_its_samples() -> None:
    first, second = np.array([0.0, 1.0, 4.0, 9.0]), np.array([5.0, 3.0, 8.0, 8.0])
    table = EvenTable(2.0, 0.5, [first, second], torch.zeros(1, dtype=torch.float64))
    at = torch.tensor([[2.0, 2.125], [3.25, 3.0]], dtype=torch.float64)
    squares, others = table.at(at)
    assert squares.flatten().tolist() == pytest.approx([0.0, 0.25, 6.5, 4.0])
    assert others.flatten().tolist() == pytest.approx([5.0, 4.5, 8.0, 8.0])
    # A thousandth of a step before the last sample, which would need one more.
    assert float(table.at(torch.tensor(9.0, dtype=torch.float64))[0]) == pytest.approx(9 - 5 * 0.001)
