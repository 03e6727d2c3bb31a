"""Designed patterns: within what a projector shows, the same every time, and better by their own measure."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.errors import PlanError
from dsl_core.model.plan import CapturePlan
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
