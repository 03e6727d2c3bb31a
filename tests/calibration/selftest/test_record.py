"""The points behind the figures of a self-test agree with what is true of the rig."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from dsl_core.calibration.selftest import record
from dsl_core.calibration.selftest.cycle import Cycle, advised_exposures
from dsl_core.calibration.selftest.readings import joined
from dsl_core.calibration.selftest.record import (
    PUBLISHED_MS,
    WANTED_MS,
    _ramp,
    analyse,
    cycle_of,
    needs_spread,
    selftest_curves,
)
from dsl_core.campaign.selftest.capture import SelfTestRun
from dsl_core.errors import CalibrationError
from dsl_core.model.calibration.selftest import Measured
from dsl_core.progress import NoProgress
from tests.cases.cycle_readings import short_exposures, table
from tests.cases.light_rig import LightWorld, light_rig


@pytest.mark.slow
def test_points_agree_with_the_figures() -> None:
    capture = SelfTestRun(light_rig(LightWorld(late_ms=12.0)), NoProgress(), (100.0,)).capture()
    found, curves = analyse(capture), selftest_curves(capture)
    for line, percent in zip(curves.lines, found.camera.linearity_percent, strict=True):
        assert 100 * np.abs(line.residual_dn).max() / curves.full_scale_dn == pytest.approx(percent.value)
    assert [ramp.colour for ramp in curves.ramps] == ["white", "red", "green", "blue"]
    for ramp in curves.ramps:
        assert len(ramp.level) >= 4
        assert ramp.light == pytest.approx(ramp.level**2.2, abs=0.01)
    assert curves.right_share[curves.waits_ms >= found.latency.wait_ms.value].min() == 1
    assert curves.right_share[curves.waits_ms < 12.0].max() < 1
    assert found.cycle.method == "timestamps"


STEADY = Cycle(None, Measured(value=0.001, std=1e-4))
NONE = Cycle(None, Measured(value=0.2, std=0.01))
FOUND = Cycle(Measured(value=20.0, std=0.01), Measured(value=0.3, std=0.01))


@pytest.mark.parametrize(
    ("cycle", "trusted", "needed"),
    [(STEADY, True, False), (STEADY, False, False), (NONE, True, True), (NONE, False, True),
     (FOUND, True, False), (FOUND, False, True)],
)  # fmt: skip
def test_spreads_are_needed_for_a_cycle_without_time_stamps_to_trust(
    cycle: Cycle, trusted: bool, needed: bool
) -> None:
    readings = short_exposures(60.0)
    times = readings.timestamp_s if trusted else np.zeros(96)
    assert needs_spread(replace(readings, timestamp_s=times), cycle) == needed


def test_a_cycle_comes_from_times_or_else_from_spreads(monkeypatch: pytest.MonkeyPatch) -> None:
    readings, by_spread = short_exposures(60.0), Cycle(Measured(value=8.0, std=0.1), FOUND.modulation)
    answers = {"times": FOUND, "spread": by_spread}
    monkeypatch.setattr(record, "find_cycle", lambda *_: answers["times"])
    monkeypatch.setattr(record, "find_cycle_by_spread", lambda *_: answers["spread"])
    assert cycle_of(readings, None, 0.0) == (FOUND, "timestamps")
    assert cycle_of(readings, readings, 0.0) == (FOUND, "timestamps")
    answers["times"] = NONE
    assert cycle_of(readings, None, 0.0) == (NONE, "timestamps")
    assert cycle_of(readings, readings, 0.0) == (by_spread, "spread")
    answers["spread"] = STEADY
    assert cycle_of(readings, readings, 0.0) == (STEADY, "spread")
    answers["spread"] = NONE
    with pytest.raises(CalibrationError, match="varies by 20% without a cycle"):
        cycle_of(readings, readings, 0.0)


def test_wanted_exposures_hold_whole_cycles_at_60_hz_and_published_ones_do_not() -> None:
    assert advised_exposures(1000 / 60, WANTED_MS) == pytest.approx(WANTED_MS)
    assert [round(ms * 60 / 1000, 9) for ms in WANTED_MS] == [10, 20]
    assert [round(ms * 60 / 1000, 9) for ms in PUBLISHED_MS] == [9.6, 19.2]


def test_points_of_a_ramp_are_light_over_that_of_the_power_law_at_full_drive() -> None:
    drive = np.array([25, 64, 102, 153, 204, 255])
    light = (drive / 255) ** 2.2 * 90.0
    light[1] *= 1.3
    exposure, glow = np.full(6, 10.0), np.array([0.5, 0.4, 0.3])
    mean = 260 + exposure[:, None] * (light[:, None] * [0.2, 1.0, 0.1] + glow)
    clipped = np.zeros((6, 3))
    clipped[5, 1] = 1.0
    ramp = replace(table(exposure, mean), drive=drive[:, None] * np.array([0, 1, 0]), clipped=clipped)
    capture = SimpleNamespace(parts={"ramps": joined(ramp, replace(ramp, drive=ramp.drive[:, [1, 0, 2]]))})
    found = _ramp(capture, "green", 260.0, glow)  # type: ignore[arg-type]
    assert found.colour == "green"
    assert found.level == pytest.approx(drive[:5] / 255)
    bright = slice(1, 5)
    full = np.exp(np.polyfit(np.log(drive[bright] / 255), np.log(light[bright]), 1)[1])
    assert found.light == pytest.approx(light[:5] / full)
