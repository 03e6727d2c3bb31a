"""Designed patterns: lines that keep apart, the same every time, and better than combs by expected error."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.errors import PlanError
from dsl_core.model.plan import CapturePlan, GrayCode, LineComb
from dsl_core.model.spectral import WavelengthGrid
from dsl_core.patterns.multiplexed import profiles
from dsl_core.planning import design as module
from dsl_core.planning import judge as judging
from dsl_core.planning.design import DARK_PX, MixedLines, _kinds, design
from dsl_core.planning.designed import designed_sets, load_design
from dsl_core.planning.judge import Judge, training_spectra
from dsl_core.resources import resource_path
from dsl_core.simulation.published_rig import published_rig

GRID = WavelengthGrid(step_nm=10)
PLAN = CapturePlan(code=GrayCode(rows=False))


def test_every_run_of_slots_holds_each_frame_once_and_lines_keep_apart() -> None:
    lines = MixedLines(frames=32, width_px=7, step_px=3, seed=3)
    order = lines.order(256)
    for start in range(0, 256, 32):
        assert sorted(order[start : start + 32].tolist()) == list(range(32))
    levels = lines.levels(640)
    assert set(np.unique(levels)) == {0, 255}
    assert np.array_equal(levels[..., 0], levels[..., 2])
    for frame in levels[..., 0]:
        edges = np.flatnonzero(np.diff(np.r_[0, frame > 0, 0].astype(int)))
        starts, stops = edges[::2], edges[1::2]
        assert (starts[1:] - stops[:-1]).min() >= DARK_PX
        assert (stops - starts)[:-1].tolist() == [7] * (len(starts) - 1)


def test_orders_follow_from_seeds_and_differ_from_each_other() -> None:
    first, again, other = (MixedLines(16, 6, 4, seed).levels(640) for seed in (1, 1, 2))
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)


def test_lines_that_cannot_keep_apart_are_refused() -> None:
    with pytest.raises(PlanError, match="cannot be kept apart"):
        MixedLines(frames=8, width_px=20, step_px=2, seed=1).order(64)
    for frames in (4, 200):
        with pytest.raises(PlanError, match="8 to 160"):
            design(published_rig(), PLAN, frames)


@pytest.mark.slow
def test_a_design_is_expected_to_beat_the_best_comb_and_is_the_same_again(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(judging, "PLACES", (4, 1))
    monkeypatch.setattr(module, "WIDTHS_PX", (6,))
    monkeypatch.setattr(module, "RUNS", (0.5,))
    made, again = (design(published_rig(), PLAN, 16, grid=GRID, orders=2) for _ in range(2))
    assert np.array_equal(made.levels, again.levels)
    assert made.error == again.error
    assert made.error < 0.97 * made.comb_error
    shown = profiles(made.columns, 640)
    assert np.array_equal(np.round(255 * shown).astype(np.uint8), made.levels)


def test_a_comb_that_finds_columns_coarsely_is_worth_less(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(judging, "PLACES", (6, 1))
    judge = Judge(published_rig(), PLAN, GRID)
    errors = [judge.error(LineComb(width_px=w, step_px=4, period_px=64)) for w in (6, 8)]
    # Both edges of 8 columns lie on the same ones of every four, so that columns between them are not found.
    assert errors[1] > 1.1 * errors[0]


def test_spectra_of_designs_are_reflectances_from_calm_to_narrow() -> None:
    spectra = training_spectra()
    assert spectra.min() >= 0
    assert spectra.max() <= 0.95
    rough = np.abs(np.diff(spectra[:, ::5], 2, axis=1)).max(1)
    assert rough.max() > 30 * rough.min()


def test_sets_that_come_with_the_program_are_the_lines_that_they_name() -> None:
    """Orders follow from seeds by a random generator that must not change under shipped sets."""
    found = {made.lines: made.array for made in map(load_design, resource_path("patterns").glob("*.json"))}
    expected = (MixedLines(16, 6, 4, 10), MixedLines(32, 9, 2, 24), MixedLines(64, 9, 1, 2))
    assert set(found) == {lines.name for lines in expected}
    for lines in expected:
        assert np.array_equal(found[lines.name], lines.levels(640))
    assert [len(columns.levels) for columns in designed_sets().values()] == [16, 32, 64]


@pytest.mark.parametrize("frames", [8, 16, 64])
def test_lines_grow_with_the_columns_of_a_projector(frames: int) -> None:
    rig = published_rig()
    wide = rig.model_copy(update={"projector": rig.projector.resized(1920, 1080)})
    known, found = list(_kinds(rig, frames)), list(_kinds(wide, frames))
    assert {3 * lines.width_px for lines in known} == {lines.width_px for lines in found}
    assert {lines.dark_px for lines in known} == {DARK_PX}
    assert {lines.dark_px for lines in found} == {3 * DARK_PX}
    levels = found[0].levels(1920)[..., 0]
    for frame in levels:
        edges = np.flatnonzero(np.diff(np.r_[0, frame > 0, 0].astype(int)))
        assert (edges[2::2] - edges[1:-1:2]).min(initial=3 * DARK_PX) >= 3 * DARK_PX
