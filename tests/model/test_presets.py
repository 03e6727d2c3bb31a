from __future__ import annotations

import numpy as np
import pytest

from dsl_core.model.plan import CapturePlan, LineComb
from dsl_core.model.presets import PRESETS, PUBLISHED_COLUMNS, Preset, on_columns, on_cycles, whole_cycles
from dsl_core.patterns.images import spectral_profiles


@pytest.mark.parametrize("preset", PRESETS, ids=lambda preset: preset.key)
def test_presets_can_be_projected(preset: Preset) -> None:
    assert len(spectral_profiles(preset.plan)) == preset.plan.spectral_count


def test_the_reference_is_the_published_plan() -> None:
    # But for the shots that watch over the scan.
    assert PRESETS[-1].plan.model_copy(update={"sentinels": None}) == CapturePlan()
    assert CapturePlan().shot_count == 716


def test_presets_run_from_quick_to_slow() -> None:
    seconds = [preset.plan.duration_s(50) for preset in PRESETS]
    assert seconds[0] == min(seconds)
    assert seconds[-1] == max(seconds)


def test_exposures_hold_whole_cycles_of_another_projector() -> None:
    plan = on_cycles(CapturePlan(), 1000 / 144)
    assert [whole_cycles(s.exposure_ms, 1000 / 144) for s in plan.settings] == [24, 48]
    assert plan.settings[0].exposure_ms == pytest.approx(24 * 1000 / 144, rel=1e-12)
    assert on_cycles(CapturePlan(), 400.0).settings[0].exposure_ms == 400.0


COMBS = [preset for preset in PRESETS if isinstance(preset.plan.spectral, LineComb)]


@pytest.mark.parametrize("preset", COMBS, ids=lambda preset: preset.key)
@pytest.mark.parametrize("width_px", [854, 1280, 1920, 3840])
def test_combs_grow_with_the_columns_of_a_projector(preset: Preset, width_px: int) -> None:
    was, comb = preset.plan.spectral, on_columns(preset.plan, width_px).spectral
    assert isinstance(was, LineComb)
    assert isinstance(comb, LineComb)
    times = width_px / PUBLISHED_COLUMNS
    assert comb.period_px == pytest.approx(times * was.period_px, rel=0.15)
    assert comb.width_px == pytest.approx(times * was.width_px, abs=2.5)
    # Frames are told apart by edges that are nowhere more than two columns apart.
    edges = np.arange(0, comb.period_px, comb.step_px)
    edges = np.unique(np.r_[edges, edges + comb.width_px] % comb.period_px)
    assert np.diff(np.r_[edges, comb.period_px]).max() <= 2
    assert comb.period_px % comb.step_px == 0


@pytest.mark.parametrize("preset", PRESETS, ids=lambda preset: preset.key)
def test_presets_are_as_they_were_on_the_published_projector(preset: Preset) -> None:
    for width_px in (480, PUBLISHED_COLUMNS, 800):
        assert on_columns(preset.plan, width_px) == preset.plan


def test_a_comb_that_somebody_chose_stays() -> None:
    own = CapturePlan(spectral=LineComb(width_px=5, step_px=2, period_px=81))
    assert on_columns(own, 1280) == own
    # On a wide projector the comb of the published one is a choice.
    chosen = COMBS[0].plan.model_copy(update={"projector_size_px": (1280, 720)})
    assert on_columns(chosen, 1280) == chosen


def test_a_preset_goes_from_one_projector_to_another() -> None:
    plan = COMBS[0].plan
    wide = on_columns(plan, 1280).model_copy(update={"projector_size_px": (1280, 720)})
    assert on_columns(wide, 1920).spectral == on_columns(plan, 1920).spectral
    assert on_columns(wide, 640).spectral == plan.spectral
