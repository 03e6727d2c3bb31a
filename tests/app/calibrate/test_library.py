"""The library restores, exports, imports and checks for drift."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from dsl_app.connection.state import Link, RigChoice
from dsl_app.shared.jobs.base import Job

from dsl_core.devices.conditions import current_conditions
from dsl_core.errors import DeviceError
from dsl_core.io.calibration_library import CalibrationLibrary
from dsl_core.model.rig import Provenance
from tests.app.calibrate.calibrate_bench import (
    CalibrateBench,
    calibrate,
    make_bench,
)
from tests.app.support.doubles import InlineRunner


def test_the_library_restores_exports_imports_and_is_used(bench: CalibrateBench, tmp_path: Path) -> None:
    library, state = bench.control.library, bench.state
    for name in ("selftest", "geometry"):
        calibrate(bench, name)
    first = bench.library.stamps("campaign")[0]
    rig = bench.library.find("campaign").rig
    bench.library.store("campaign", rig.model_copy(update={"white_scale": 1.0}))
    library.load()
    assert [line.is_current for line in state.library.value] == [True, False]
    library.restore("campaign", first)
    assert bench.library.find("campaign").stamp == first
    library.export(f"campaign@{first}", tmp_path / "out.json", "entry", False)
    library.export(f"campaign@{first}", tmp_path / "out.json", "entry", False)
    assert "already exists" in bench.told
    other = CalibrationLibrary(tmp_path / "elsewhere")
    assert other.names() == ()
    assert bench.control.open(tmp_path / "out.json")
    assert len(bench.library.stamps("campaign")) == 3
    (tmp_path / "other.json").write_text(json.dumps({"a": 1}))
    assert not bench.control.open(tmp_path / "other.json")
    opened: list[Path] = []
    state.opened.connect(opened.append)
    library.report("campaign")
    assert "<html" in opened[0].read_text()
    library.use("campaign")
    assert state.in_use.value == "campaign"


def test_a_calibration_that_is_gone_is_not_used(bench: CalibrateBench) -> None:
    bench.control.library.use("Werk")
    assert "Werk" in bench.told
    assert (bench.state.in_use.value, bench.state.note.value) == ("", "")


def test_a_window_that_closes_while_the_library_is_read_asks_nothing(
    bench: CalibrateBench, monkeypatch: pytest.MonkeyPatch
) -> None:
    read, submit = list[bool](), InlineRunner.submit

    def note(runner: InlineRunner, job: Job[Any]) -> Job[Any]:
        read.append(job.is_minor)
        return submit(runner, job)

    monkeypatch.setattr(InlineRunner, "submit", note)
    bench.control.library.load()
    assert read == [True]


def test_a_drift_check_needs_the_rig_that_was_calibrated(bench: CalibrateBench) -> None:
    devices, calibration = bench.calibrated
    assert bench.control.library.must_be_placed
    conditions = current_conditions(devices)
    other = conditions.model_copy(
        update={"projector": conditions.projector.model_copy(update={"mode": "6500 K"})}
    )
    bench.library.store("other", calibration.model_copy(update={"conditions": other}))
    bench.control.library.check("other")
    assert "the projector's mode was 6500 K and is not named" in bench.told
    assert bench.state.drift.value is None
    assert set(bench.notifier.offers) == {"Check anyway"}
    bench.rig.disconnect()
    bench.control.library.check("other")
    assert "No rig is connected" in bench.told


@pytest.fixture
def plane(tmp_path: Path) -> CalibrateBench:
    """A connected twin of a flat target that can be checked for drift."""
    choice = RigChoice("twin", (("scene", "plane"), ("size", "112x72")))
    made = make_bench(tmp_path, choice=choice)
    made.rig.connect(choice)
    return made


def test_a_drift_check_that_loses_a_device_loses_the_rig(
    plane: CalibrateBench, monkeypatch: pytest.MonkeyPatch
) -> None:
    def gone(*_: object) -> None:
        raise DeviceError("The camera does not answer. Check its cable.")

    monkeypatch.setattr(plane.library, "find", gone)
    plane.control.library.check("own")
    assert plane.rig.state.link.value is Link.LOST
    assert "does not answer" in plane.told


@pytest.mark.slow
def test_a_drift_check_of_the_twin_says_that_nothing_has_moved(plane: CalibrateBench) -> None:
    _, calibration = plane.calibrated
    dated = calibration.model_copy(update={"provenance": Provenance(created="2026-03-01")})
    plane.library.store("own", dated)
    plane.control.library.check("own")
    verdict = plane.state.drift.value
    assert verdict is not None, plane.told
    assert len(plane.library.find("own").rig.light_checks) == 1
    assert "state the light by this check" in plane.state.note.value
    assert {figure.name for figure in verdict.figures} >= {"row drift"}
    assert "The rig matches the calibration own." in plane.state.note.value


@pytest.mark.slow
def test_a_check_in_spite_of_other_settings_says_which(plane: CalibrateBench) -> None:
    devices, calibration = plane.calibrated
    conditions = current_conditions(devices)
    gain = conditions.camera.model_copy(update={"gain_db": 6.0})
    other = calibration.model_copy(update={"conditions": conditions.model_copy(update={"camera": gain})})
    plane.library.store("own", other)
    plane.control.library.check("own")
    assert "the camera's gain (dB) was 6 and is 0" in plane.told
    plane.notifier.offers["Check anyway"]()
    verdict = plane.state.drift.value
    assert verdict is not None, plane.told
    assert verdict.overridden == ("the camera's gain (dB) was 6 and is 0",)
