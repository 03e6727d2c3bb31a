"""Exposures that nobody chose suit the projector; chosen ones stay."""

from __future__ import annotations

import pytest

from dsl_core.capture.preflight import fit_plan
from dsl_core.devices.registry import open_rig
from dsl_core.model.plan import CapturePlan, Setting

TWIN = {"size": "160x104", "scene": "plane"}


@pytest.mark.parametrize(("rate_hz", "cycles"), [(60.0, [10, 20]), (50.0, [8, 17])])
def test_default_exposures_are_whole_colour_cycles(rate_hz: float, cycles: list[int]) -> None:
    chosen = CapturePlan(settings=(Setting(exposure_ms=25.0, level=0.5),), code_settings=(0,))
    with open_rig("twin", {**TWIN, "led_cycle_hz": str(rate_hz)}) as rig:
        fitted = fit_plan(CapturePlan(), rig)
        assert [s.exposure_ms * rate_hz / 1000 for s in fitted.settings] == pytest.approx(cycles)
        assert fit_plan(chosen, rig).settings == chosen.settings
    if rate_hz == 60:
        assert fitted.settings == CapturePlan().settings
