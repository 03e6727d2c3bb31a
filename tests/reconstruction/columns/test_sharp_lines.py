"""Lines side by side of a sharp projector: columns at their ends are known, and none is unlike them."""

from __future__ import annotations

import pytest
import torch

from dsl_core.model.rig import ProjectorResponse
from dsl_core.optics.lines.line_set import LineSet
from dsl_core.optics.lines.profile import zero_order_profile
from dsl_core.reconstruction.columns.column import Column, refine
from dsl_core.reconstruction.columns.line_peaks import LinePeaks

LINES = LineSet(5, 5, 2.0, 20, 20)
NOISE = 0.003


def refined(
    blur_px: float, halo_per_px: float = 0.0, noise: float = NOISE, model_error: float | None = None
) -> tuple[Column, torch.Tensor, torch.Tensor]:
    """Columns of many places, where they are, and how far from the nearest end of a line (px)."""
    generator = torch.Generator().manual_seed(4)
    column = 20 + 60 * torch.rand(4000, generator=generator, dtype=torch.float64)
    centres = 2.0 + 5.0 * torch.arange(20, dtype=torch.float64)[:, None]
    response = ProjectorResponse(blur_px=blur_px, halo_peak_per_px=halo_per_px, halo_decay_px=30.0)
    light = zero_order_profile(column - centres, -2.5, 2.5, response)
    light = light + noise * torch.randn(light.shape, generator=generator, dtype=torch.float64)
    peaks = LinePeaks(column.round(), light, torch.full_like(light, noise), LINES, response)
    return refine(peaks, model_error), column, ((column + 0.5) / 5 - ((column + 0.5) / 5).round()).abs() * 5


@pytest.mark.parametrize("blur_px", [0.3, 0.45, 0.6])
def test_columns_at_the_ends_of_lines_are_known_however_sharp_these_are(blur_px: float) -> None:
    found, column, from_end = refined(blur_px)
    error = found.column_px - column
    near = from_end < 1.2 * blur_px
    assert found.refined[near].all()
    assert float(error[near].square().mean().sqrt()) < 0.04
    # In between the code says where columns are, and nothing else does.
    assert float(error.square().mean().sqrt()) < 0.3
    assert float((error.abs() < 1.96 * found.std_px).double().mean()) > 0.93


@pytest.mark.parametrize("blur_px", [0.3, 0.45, 0.6])
def test_no_sharp_line_is_taken_for_one_of_another_shape(blur_px: float) -> None:
    assert not refined(blur_px)[0].unusual.any()


def test_halo_is_not_taken_for_the_end_of_a_line() -> None:
    found, column, _ = refined(0.3, halo_per_px=1e-3, noise=5e-4, model_error=0.0)
    off = (found.column_px - column).abs() / found.std_px
    assert float((off > 3.5).double().mean()) < 0.01


def test_combs_are_as_unsure_as_stated_between_sharp_ends_of_lines() -> None:
    combs = LineSet(width_px=6, step_px=4, first_px=2.5, lines=150, frames=16)
    response = ProjectorResponse(blur_px=0.3)
    generator = torch.Generator().manual_seed(5)
    column = 200 + 200 * torch.rand(3000, generator=generator, dtype=torch.float64)
    line = torch.arange(combs.lines)
    light = zero_order_profile(column - combs.centre_px(line)[:, None], -3.0, 3.0, response)
    frames = torch.zeros((combs.frames, len(column)), dtype=torch.float64).index_add_(
        0, combs.frame(line), light
    )
    frames += NOISE * torch.randn(frames.shape, generator=generator, dtype=torch.float64)
    found = refine(LinePeaks(column.round(), frames, torch.full_like(frames, NOISE), combs, response), NOISE)
    off = (found.column_px - column).abs() / found.std_px
    assert float((off > 3.5).double().mean()) < 0.012
    assert float((off < 1.96).double().mean()) > 0.97
