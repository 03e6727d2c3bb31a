"""The Rig page tells in what the rig is unlike the usual, by the calibration that scans use."""

from __future__ import annotations

from pathlib import Path

import pytest
from dsl_app.connection.controller import RigController
from dsl_app.connection.state import RigChoice, RigState
from dsl_app.rig.controller import LiveController
from dsl_app.rig.page import RigPage
from dsl_app.rig.traits import TraitsReader
from pytestqt.qtbot import QtBot

from dsl_core.io.calibration_library import CalibrationLibrary
from dsl_core.model.calibration.accepted import CalibrationNote
from dsl_core.model.calibration.selftest import OFF_POWER_LAW
from dsl_core.model.figure import Figure
from dsl_core.simulation.published_rig import published_rig
from tests.app.support.doubles import InlineRunner, RecordingNotifier

TWIN = RigChoice("twin", (("scene", "plane"), ("size", "64x48")))


def test_the_page_tells_what_the_calibration_in_use_measured(
    qtbot: QtBot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("DSL_SCAN_HOME", str(tmp_path))
    off = Figure(name=OFF_POWER_LAW, value=0.9, std=0.01, unit="%")
    note = CalibrationNote(
        name="selftest", title="Self-test", accepted="2026-03-01T10:20:30+00:00", figures=(off,)
    )
    CalibrationLibrary().store("room", published_rig().model_copy(update={"calibrations": (note,)}))
    used, notifier = [""], RecordingNotifier()
    rig = RigController(RigState(TWIN), InlineRunner(), notifier)
    traits = TraitsReader(rig.state, InlineRunner(), lambda: used[0])
    page = RigPage(LiveController(rig, notifier), ["twin"], traits)
    qtbot.addWidget(page)
    page.show()
    rig.connect(TWIN)
    assert not page.traits.isVisible(), "the twin's own calibration was never measured"
    told = {}
    for used[0] in ("room", "gone"):
        page.hide()
        page.show()
        told[used[0]] = page.traits.text() if page.traits.isVisible() else ""
    assert "0.90 % (rms) off a power law" in told["room"]
    assert told["gone"] == ""
    used[0] = "room"
    traits.read()
    rig.disconnect()
    assert traits.words.value == ""
    page.release()
