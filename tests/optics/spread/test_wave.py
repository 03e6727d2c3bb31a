"""Waves of columns over smooth runs of pixels."""

from __future__ import annotations

import math

import pytest
import torch

from dsl_core.optics.spread.wave import _significant, column_wave

PERIOD_PX = 2.0


def runs(pitch_px: float = 0.73, count: int = 300, length: int = 10) -> torch.Tensor:
    """Columns of smooth runs: planes and slightly curved surfaces."""
    generator = torch.Generator().manual_seed(0)
    start, slope, bend = torch.rand((3, count, 1), generator=generator, dtype=torch.float64)
    at = torch.arange(length, dtype=torch.float64)
    column: torch.Tensor = 600 * start + (pitch_px + 0.2 * slope) * at + 0.01 * bend * at**2
    return column


def waved(column: torch.Tensor) -> torch.Tensor:
    angle = 2 * math.pi / PERIOD_PX * column
    return 0.05 * torch.sin(angle + 0.4) - 0.02 * torch.cos(2 * angle)


def test_a_wave_with_the_period_of_the_lines_is_found_under_noise() -> None:
    true = runs()
    noise = 0.01 * torch.randn(true.shape, generator=torch.Generator().manual_seed(1), dtype=torch.float64)
    column, used = true + waved(true) + noise, torch.ones_like(true, dtype=torch.bool)
    # Each time most of it is found: what short runs show badly is held back.
    for left in (0.4, 0.2, 0.1):
        found = column_wave(column, used, PERIOD_PX)
        column = column - found.px
        rest = (column - noise - true).square().mean().sqrt()
        assert rest < left * waved(true).square().mean().sqrt()
    assert found.smooth.float().mean() > 0.99
    assert 0.008 < found.std_px < 0.012


def test_smooth_columns_have_no_wave() -> None:
    true = runs()
    found = column_wave(true, torch.ones_like(true, dtype=torch.bool), PERIOD_PX)
    assert found.px.abs().max() < 1e-3


def test_runs_over_an_edge_are_left_out() -> None:
    true = runs()
    broken = true.clone()
    broken[:30, 4:] += 3.3
    used = torch.ones_like(true, dtype=torch.bool)
    used[30:40, 2:] = False
    found = column_wave(broken + waved(true), used, PERIOD_PX)
    assert not found.smooth[:40].any()
    assert found.smooth[40:].all()
    assert (found.px - waved(true))[40:].square().mean() < 0.15 * waved(true).square().mean()


def test_runs_that_cannot_show_a_wave_give_none() -> None:
    """Pixels at whole periods from each other are all off by the same."""
    at = torch.arange(10, dtype=torch.float64) * PERIOD_PX
    column = 10.0 + at + torch.linspace(0, 400, 50, dtype=torch.float64)[:, None]
    found = column_wave(column + waved(column), torch.ones_like(column, dtype=torch.bool), PERIOD_PX)
    assert found.px.abs().max() < 0.01


@pytest.mark.parametrize(("sigmas", "kept"), [(2.9, False), (3.1, True)])
def test_a_wave_counts_from_three_deviations_of_its_runs_on(sigmas: float, kept: bool) -> None:
    """24 runs of four pixels at places of their own, each off by one more or less than the mean."""
    # With a ridge of a tenth, deviations of 24 m² / ((m / 11)² + 1), squared.
    mean = math.sqrt(sigmas**2 / (24 - sigmas**2 / 121))
    sign = torch.where(torch.arange(24) % 2 == 0, 1.0, -1.0).double()
    values = (mean + sign)[:, None].expand(24, 4)
    shapes = torch.ones((24, 4, 1), dtype=torch.float64)
    found = _significant(shapes, values, torch.arange(24.0, dtype=torch.float64))
    assert float(found[0]) == (pytest.approx(mean / 1.1) if kept else 0.0)


def test_runs_at_one_place_count_as_one() -> None:
    """Fewer places than runs: pairs of runs that are off alike are as sure as half of them."""
    sign = torch.where(torch.arange(48) // 2 % 2 == 0, 1.0, -1.0).double()
    shapes = torch.ones((48, 4, 1), dtype=torch.float64)
    for mean, kept in ((0.55, False), (0.75, True)):
        values = (mean + sign)[:, None].expand(48, 4)
        found = _significant(shapes, values, torch.arange(48.0, dtype=torch.float64))
        assert (float(found[0]) != 0.0) == kept


def test_no_wave_is_longer_than_the_period_shorter_than_half_a_pixel_or_large() -> None:
    true = runs()
    used = torch.ones_like(true, dtype=torch.bool)
    # Four waves fit into a period of two columns: the fifth is not looked for.
    for k, kept in ((4, True), (5, False)):
        short = 0.05 * torch.sin(2 * math.pi * k / PERIOD_PX * true)
        found = column_wave(true + short, used, PERIOD_PX).px
        assert (float(found.abs().max()) > 0.02) == kept, k
    huge = column_wave(true + 0.9 * torch.sin(2 * math.pi / PERIOD_PX * true), used, PERIOD_PX)
    assert float(huge.px.abs().max()) == 0.3


def test_columns_follow_polynomials_of_the_third_degree() -> None:
    at = torch.linspace(-1, 1, 12, dtype=torch.float64)
    start = torch.linspace(0, 400, 60, dtype=torch.float64)[:, None]
    used = torch.ones((60, 12), dtype=torch.bool)
    cubic = start + 4 * at + 0.8 * at**2 - 0.7 * at**3
    assert column_wave(cubic, used, PERIOD_PX).std_px < 1e-6
    assert column_wave(cubic + 0.7 * at**4, used, PERIOD_PX).std_px > 0.01


@pytest.mark.parametrize(("pixels", "smooth"), [(6, True), (5, False)])
def test_a_run_needs_six_pixels(pixels: int, smooth: bool) -> None:
    true = runs()
    used = torch.arange(true.shape[1]).expand(true.shape) < pixels
    used[100:] = True
    found = column_wave(true, used, PERIOD_PX)
    assert bool(found.smooth[:100].all()) == bool(found.smooth[:100].any()) == smooth
    none = column_wave(true[:100], used[:100] & False, PERIOD_PX)
    assert not none.smooth.any()
    assert not none.px.any()
    assert none.std_px == math.inf


@pytest.mark.parametrize(("times", "smooth"), [(3.7, True), (4.3, False)])
def test_runs_that_scatter_four_times_as_much_as_others_are_rough(times: float, smooth: bool) -> None:
    true = runs()
    noise = torch.randn(true.shape, generator=torch.Generator().manual_seed(3), dtype=torch.float64)
    powers = torch.stack([torch.linspace(-1, 1, 10, dtype=torch.float64) ** k for k in range(4)])
    noise = noise - noise @ torch.linalg.pinv(powers) @ powers
    noise = 0.01 * noise / (noise.square().sum(1, keepdim=True) / 6).sqrt()
    noise[0] *= times
    found = column_wave(true + noise, torch.ones_like(true, dtype=torch.bool), PERIOD_PX)
    assert bool(found.smooth[0]) == smooth
    assert found.smooth[1:].all()
    assert found.std_px == pytest.approx(0.01, rel=0.05)


def test_coefficients_are_least_squares_with_a_ridge_of_a_tenth() -> None:
    random = torch.Generator().manual_seed(2)
    shapes = torch.randn((40, 6, 2), generator=random, dtype=torch.float64)
    values = shapes @ torch.tensor([0.8, -0.5], dtype=torch.float64)
    flat = shapes.flatten(0, 1)
    wanted = torch.linalg.solve(flat.T @ flat + 0.1 * 240 * torch.eye(2), flat.T @ values.flatten())
    found = _significant(shapes, values, torch.arange(40.0))
    assert found.tolist() == pytest.approx(wanted.tolist())
