"""Different settings are overridden for the calibration and the differences that a person has seen."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from dsl_app.scan.state import CalibrationChoice

from dsl_core.devices.conditions import current_conditions
from tests.app.support.scan_bench import ScanBench, planned_bench


@pytest.fixture
def bench(tmp_path: Path) -> ScanBench:
    """A bench whose library has calibrations at other gains, 6 and 12 dB, of which the first is in use."""
    made = planned_bench(tmp_path)
    devices = made.rig.state.devices.value
    assert devices is not None
    now = current_conditions(devices)
    for name, gain_db in (("six", 6.0), ("twelve", 12.0), ("six-too", 6.0)):
        other = now.model_copy(update={"camera": now.camera.model_copy(update={"gain_db": gain_db})})
        made.library.store(name, made.calibration.model_copy(update={"conditions": other}))
    made.scans.plans.choose_calibration(CalibrationChoice("six", "six"))
    return made


@pytest.mark.parametrize("other", ["twelve", "six-too"])
def test_another_calibration_is_not_used_despite_its_differences(bench: ScanBench, other: str) -> None:
    bench.scans.plans.set_override(True)
    facts = bench.state.facts.value
    assert facts is not None
    assert not facts.obstacles
    bench.scans.plans.choose_calibration(CalibrationChoice(other, other))
    assert not bench.state.override.value
    facts = bench.state.facts.value
    assert facts is not None
    assert "gain" in facts.obstacles[0]
    assert "--override-calibration" not in bench.scans.command_line()


@pytest.mark.parametrize(("gain_db", "stays"), [(3.0, False), (6.0, True), (0.0, True)])
def test_an_override_holds_for_the_differences_that_were_seen(
    bench: ScanBench, gain_db: float, stays: bool
) -> None:
    bench.scans.plans.set_override(True)
    devices = bench.rig.state.devices.value
    assert devices is not None
    info = devices.camera.info
    devices.camera._info = replace(info, gain_db=gain_db)  # type: ignore[attr-defined]
    bench.scans.plans.refresh()
    assert bench.state.override.value is stays


def test_what_is_overridden_stays_in_sight(bench: ScanBench) -> None:
    bench.scans.plans.set_override(True)
    facts = bench.state.facts.value
    assert facts is not None
    assert facts.settings_differ
    assert "Used despite different settings: the camera's gain (dB) was 6 and is 0." in facts.remarks[0]
    bench.scans.plans.set_override(False)
    facts = bench.state.facts.value
    assert facts is not None
    assert not any("despite" in remark for remark in facts.remarks)
