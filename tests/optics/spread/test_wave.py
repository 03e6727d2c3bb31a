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
