from __future__ import annotations

import pytest

from dsl_core.model.plan import CapturePlan
from dsl_core.model.presets import PRESETS, Preset, on_cycles, whole_cycles
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
