"""Columns from any pattern set: combs in three colours and random levels, with honest deviations."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from dsl_core.model.plan import CapturePlan, Columns, GrayCode, LineComb, SpectralSet
from dsl_core.model.rig import Rig
from dsl_core.optics.image_formation import BlurredProfiles
from dsl_core.reconstruction.column import Column
from dsl_core.reconstruction.line_set import LineSet
from dsl_core.reconstruction.pattern_column import radiance_profiles, refine_by_profiles
from tests.cases.small_rig import small_rig

WHITE = 300.0
NOISE = 1.0


def random_columns() -> Columns:
    rng = np.random.default_rng(4)
    levels = (rng.random((24, 640, 1)) < 0.2) * np.ones(3)
    return Columns(levels=tuple(tuple(tuple(rgb) for rgb in frame) for frame in levels.tolist()))


def refined(
    spectral: SpectralSet, rig: Rig, shares: tuple[float, float, float]
) -> tuple[Column, torch.Tensor]:
    """Fit pixels whose LEDs give ``shares`` of white, from a decoded column half a pixel off at most."""
    plan = CapturePlan(code=GrayCode(rows=False), spectral=spectral)
    profiles = radiance_profiles(rig, plan)
    draw = torch.Generator().manual_seed(3)
    true = 100 + 400 * torch.rand(200, generator=draw)
    light = BlurredProfiles(rig.projector_response, profiles, 0.0, true).at(true)
    y = WHITE * torch.einsum("plf,l->fp", light, torch.tensor(shares))
    y = y + NOISE * torch.randn(y.shape, generator=draw)
    return refine_by_profiles(
        true.round(), y, torch.full_like(y, NOISE), profiles, rig.projector_response
    ), true


@pytest.mark.parametrize(
    "spectral",
    [LineComb(width_px=5, step_px=3, period_px=96, shifts_px=(0, 32, 64)), random_columns()],
    ids=["comb in three colours", "random"],
)
def test_columns_are_found_far_better_than_decoded(spectral: SpectralSet) -> None:
    column, true = refined(spectral, small_rig(), (0.5, 0.3, 0.2))
    assert column.refined.float().mean() > 0.9
    error = (column.column_px - true)[column.refined]
    assert float(error.square().mean().sqrt()) < 0.06
    assert float((error / column.std_px[column.refined]).abs().median()) < 1.5


def test_amplitude_is_that_of_white() -> None:
    column, _ = refined(random_columns(), small_rig(), (0.5, 0.3, 0.2))
    assert float(column.amplitude[column.refined].median()) == pytest.approx(WHITE, rel=0.02)


def test_saturated_frames_take_no_part() -> None:
    rig = small_rig()
    plan = CapturePlan(code=GrayCode(rows=False), spectral=random_columns())
    profiles = radiance_profiles(rig, plan)
    true = torch.tensor([200.3, 300.2])
    light = BlurredProfiles(rig.projector_response, profiles, 0.0, true).at(true)
    y = WHITE * light.sum(1).T / 3
    std = torch.full_like(y, NOISE)
    y[:4], std[:4] = 5 * WHITE, torch.inf
    column = refine_by_profiles(true.round(), y, std, profiles, rig.projector_response)
    assert torch.allclose(column.column_px, true, atol=0.06)


def test_a_comb_in_three_colours_is_no_set_of_white_lines() -> None:
    comb = LineComb(width_px=5, step_px=3, period_px=96, shifts_px=(0, 32, 64))
    assert LineSet.of(CapturePlan(spectral=comb)) is None
    assert LineSet.of(CapturePlan(spectral=comb.model_copy(update={"shifts_px": (0, 0, 0)}))) is not None
