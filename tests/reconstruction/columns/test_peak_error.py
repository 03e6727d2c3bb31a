"""The error of a modelled peak as the peaks themselves show it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from dsl_core.model.rig import ProjectorResponse
from dsl_core.optics.lines.line_set import LineSet
from dsl_core.optics.lines.profile import zero_order_profile
from dsl_core.reconstruction.columns.column import COMB_ERROR, refine
from dsl_core.reconstruction.columns.line_peaks import LinePeaks
from dsl_core.reconstruction.columns.peak_error import LARGEST, _excess, peak_error

LINES = LineSet(width_px=5, step_px=2, first_px=2.0, lines=118, frames=118)
RESPONSE = ProjectorResponse(blur_px=0.6, halo_peak_per_px=1e-3, halo_decay_px=31.0)
NOISE = 0.002


def peaks(blur_px: float) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    """Columns, noisy line frames (frames, pixels) of a projector with a blur, and their deviations."""
    generator = torch.Generator().manual_seed(2)
    column = 60 + 100 * torch.rand(1500, generator=generator, dtype=torch.float64)
    centre = LINES.centre_px(torch.arange(LINES.lines))[:, None]
    half = LINES.width_px / 2
    exact = zero_order_profile(column - centre, -half, half, RESPONSE.with_gaussian(blur_px))
    noise = torch.randn(exact.shape, generator=generator, dtype=torch.float64)
    return column, exact + NOISE * noise, torch.full_like(exact, NOISE)


def test_peaks_as_modelled_have_no_error_but_their_noise() -> None:
    column, radiance, std = peaks(0.6)
    assert peak_error(LinePeaks(column.round(), radiance, std, LINES, RESPONSE)) < NOISE / 5
    usual, own = (
        refine(LinePeaks(column.round(), radiance, std, LINES, RESPONSE), model_error=error)
        for error in (0.0015, 0.0)
    )
    assert (own.column_px - column).std() <= (usual.column_px - column).std()
    assert own.std_px.median() < 0.9 * usual.std_px.median()
    assert ((own.column_px - column) / own.std_px).std() == pytest.approx(0.95, abs=0.1)


def test_what_a_wrong_model_leaves_becomes_its_error_and_widens_deviations() -> None:
    column, radiance, std = peaks(0.62)
    found = peak_error(LinePeaks(column.round(), radiance, std, LINES, RESPONSE))
    assert 0.002 < found < 0.02
    wide = refine(LinePeaks(column.round(), radiance, std, LINES, RESPONSE), model_error=found)
    assert ((wide.column_px - column).abs() < 1.96 * wide.std_px).double().mean() > 0.93


def test_there_is_a_largest_error() -> None:
    column, radiance, std = peaks(1.6)
    assert peak_error(LinePeaks(column.round(), radiance, std, LINES, RESPONSE)) == pytest.approx(LARGEST)


COMBS = LineSet(width_px=6, step_px=4, first_px=2.5, lines=150, frames=16)


def comb_light(generator: torch.Generator) -> tuple[torch.Tensor, torch.Tensor]:
    """Columns of 1500 pixels, and what the frames of a comb bring each through the zero order."""
    column = 200 + 200 * torch.rand(1500, generator=generator, dtype=torch.float64)
    exact = torch.zeros((COMBS.frames, len(column)), dtype=torch.float64)
    line = torch.arange(COMBS.lines)
    half = COMBS.width_px / 2
    light = zero_order_profile(column - COMBS.centre_px(line)[:, None], -half, half, RESPONSE)
    return column, exact.index_add_(0, COMBS.frame(line), light)


def test_combs_are_asked_for_the_first_orders_under_their_peaks() -> None:
    generator, combs = torch.Generator().manual_seed(3), COMBS
    column, exact = comb_light(generator)
    exact += 0.006 * torch.randn(exact.shape, generator=generator, dtype=torch.float64)
    noise = torch.randn(exact.shape, generator=generator, dtype=torch.float64)
    seen = LinePeaks(column.round(), exact + NOISE * noise, torch.full_like(exact, NOISE), combs, RESPONSE)
    found = peak_error(seen)
    assert 0.002 < found < 0.02
    own, usual = refine(seen, found), refine(seen)
    off = (own.column_px - column).abs()
    assert 0.93 < (off < 1.96 * own.std_px).double().mean() < 0.99
    assert own.std_px.median() < 0.5 * usual.std_px.median()
    # What orders add to all frames alike makes every peak brighter, whatever its columns say.
    assert own.amplitude_std.numpy() == pytest.approx(usual.amplitude_std.numpy(), rel=0.05)
    unlike = replace(seen, radiance=exact + 0.2 * noise)
    assert peak_error(unlike) == pytest.approx(COMB_ERROR)


def test_a_colour_with_brighter_first_orders_keeps_its_columns() -> None:
    generator = torch.Generator().manual_seed(4)
    column, exact = comb_light(generator)
    blue = torch.arange(len(column)) % 4 == 3
    orders = torch.where(blue, 0.04, 0.004)
    seen = exact + orders * torch.randn(exact.shape, generator=generator, dtype=torch.float64)
    peaks = LinePeaks(column.round(), seen, torch.full_like(exact, NOISE), COMBS, RESPONSE)
    found = refine(peaks, peak_error(peaks))
    off = (found.column_px - column).abs()
    assert found.refined[blue].double().mean() > 0.99
    assert off[blue].square().mean().sqrt() < 0.15
    assert (off < 1.96 * found.std_px)[blue].double().mean() > 0.85


def test_excess_is_nothing_for_noise_and_follows_the_chi_square() -> None:
    rng = np.random.default_rng(3)
    used = rng.integers(5, 12, 20000)
    chi_square = rng.chisquare(used - 2) / (used - 2)
    assert _excess(chi_square, used) == pytest.approx(0, abs=0.02)
    assert _excess(2 * chi_square, used) == pytest.approx(1, abs=0.04)
    assert _excess(np.array([np.nan, 9.0]), np.array([7, 3])) == 0
    # Two samples more than are fitted tell something.
    assert _excess(np.array([4 * (8 / 9) ** 3]), np.array([4])) == pytest.approx(3)
