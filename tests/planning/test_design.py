"""Designed patterns: within what a projector shows, the same every time, and better by their own measure."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from dsl_core.errors import PlanError
from dsl_core.model.plan import CapturePlan, LineComb
from dsl_core.model.spectral import WavelengthGrid
from dsl_core.patterns.multiplexed import profiles
from dsl_core.planning import design as module
from dsl_core.planning.design import DesignOptions, design, starting_comb
from dsl_core.simulation.published_rig import published_rig

GRID = WavelengthGrid(step_nm=10)


def test_a_short_search_lowers_the_loss_within_8_bit(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "SAMPLES", (4, 1))
    options = DesignOptions(steps=40, samples=4, learning_rate=0.02)
    made = design(published_rig(), CapturePlan(), 8, grid=GRID, options=options)
    assert made.levels.shape == (8, 640, 3)
    assert np.array_equal(made.levels[..., 0], made.levels[..., 2])
    assert np.mean(made.losses[-8:]) < np.mean(made.losses[:8])
    shown = profiles(made.columns, 640)
    assert np.array_equal(np.round(255 * shown).astype(np.uint8), made.levels)


def test_the_start_has_the_frames_asked_for() -> None:
    for frames in (16, 32, 64):
        assert len(profiles(starting_comb(frames), 640)) == frames
    with pytest.raises(PlanError, match="8 to 160"):
        starting_comb(4)


def test_a_comb_that_finds_columns_coarsely_is_worth_less(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "SAMPLES", (8, 1))
    rig = published_rig()
    samples = module.Samples(rig, CapturePlan(), GRID)
    draw = torch.Generator().manual_seed(3)
    at = torch.arange(len(samples.zero))
    reflectance = module.random_reflectances((len(at), 2), samples.bands, draw)
    prior, means = module._prior(samples.bands.count)
    losses = []
    for width_px in (6, 8):
        comb = LineComb(width_px=width_px, step_px=4, period_px=64)
        radiance = torch.as_tensor(profiles(comb, rig.projector.width_px)).permute(1, 0, 2)
        loss = samples.loss(radiance.float(), at, reflectance, prior, means)
        losses.append(float(loss.mean().sqrt()))
    # Both edges of 8 columns lie on the same ones of every four, so that columns between them are not found.
    assert losses[1] > 1.1 * losses[0]
