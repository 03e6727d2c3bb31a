from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import pytest
from dsl_app.connection.controller import RIG, RigController
from dsl_app.connection.state import Link, RigChoice, RigState
from dsl_app.shared.jobs.base import Job
from dsl_app.shared.jobs.qt_runner import WORKERS, QtRunner
from pytestqt.qtbot import QtBot

from dsl_core.devices.base import DeviceRig
from dsl_core.errors import DeviceError
from dsl_core.model.frames import Frame
from dsl_core.progress import Progress
from dsl_core.simulation.sim_devices import SimCamera
from tests.app.support.doubles import InlineRunner, RecordingNotifier

TWIN = RigChoice("twin", (("scene", "plane"), ("size", "64x48")))


def controller(runner: object = None) -> tuple[RigController, RecordingNotifier]:
    notifier = RecordingNotifier()
    made = RigController(RigState(TWIN), runner or InlineRunner(), notifier)  # type: ignore[arg-type]
    return made, notifier


def look(progress: Progress) -> None:
    """A live view: runs until it is cancelled."""
    while True:
        progress.report("live", 0, 0)
        time.sleep(0.005)


def test_a_rig_is_connected_and_let_go() -> None:
    rig, _ = controller()
    rig.connect(TWIN)
    camera = rig.state.camera
    assert camera is not None
    assert (rig.state.link.value, camera.width_px) == (Link.OPEN, 64)
    rig.disconnect()
    assert (rig.state.link.value, rig.state.camera) == (Link.CLOSED, None)


def test_a_rig_that_cannot_be_opened_says_why() -> None:
    rig, notifier = controller()
    rig.connect(RigChoice("twin", (("scene", "moon"),)))
    assert rig.state.link.value is Link.CLOSED
    assert "moon" in rig.state.trouble.value
    assert notifier.told[0][0] == "error"


def test_why_a_rig_was_not_opened_is_taken_back_with_the_next_connection() -> None:
    rig, notifier = controller()
    rig.connect(RigChoice("twin", (("scene", "moon"),)))
    rig.connect(TWIN)
    assert notifier.told[0][1] in notifier.withdrawn


def test_the_cycle_is_the_calibrated_one() -> None:
    rig, _ = controller()
    rig.connect(TWIN)
    devices = rig.state.devices.value
    assert devices is not None
    assert devices.calibration is not None
    devices.calibration = devices.calibration.model_copy(update={"frame_period_ms": 8.0})
    assert rig.state.cycle_ms == 8.0
    devices.calibration = None
    assert rig.state.cycle_ms == devices.projector.info.frame_period_ms


@dataclass
class Busy:
    """A rig that a job holds until it is let go; ``closed`` counts devices that were closed."""

    rig: RigController
    notifier: RecordingNotifier
    runner: QtRunner
    gate: threading.Event = field(default_factory=threading.Event)
    closed: list[object] = field(default_factory=list)

    def hold(self) -> None:
        self.rig.run(Job("Scan first", self._work, exclusive=RIG))

    def _work(self, progress: Progress) -> None:
        assert self.gate.wait(60)

    def is_idle(self) -> bool:
        return self.runner.active == ()


@pytest.fixture
def busy(qtbot: QtBot, monkeypatch: pytest.MonkeyPatch) -> Iterator[Busy]:
    runner = QtRunner()
    rig, notifier = controller(runner)
    made = Busy(rig, notifier, runner)
    monkeypatch.setattr(DeviceRig, "close", lambda devices: made.closed.append(devices))
    rig.connect(TWIN)
    qtbot.waitUntil(lambda: rig.state.link.value is Link.OPEN, timeout=60_000)
    yield made
    made.gate.set()
    runner.shut_down()


def test_what_follows_a_job_finds_the_rig_free() -> None:
    rig, _ = controller()
    seen: list[str] = []
    look = lambda _: seen.append(rig.state.used_by.value)  # noqa: E731
    rig.run(Job("Look", look, look, exclusive=RIG))
    assert seen == ["Look", ""]


def test_a_rig_in_use_stays_connected_whatever_is_asked(qtbot: QtBot, busy: Busy) -> None:
    rig, state = busy.rig, busy.rig.state
    devices = state.devices.value
    links: list[Link] = []
    state.link.changed.connect(links.append)
    busy.hold()
    rig.disconnect()
    rig.connect(RigChoice("twin", (("scene", "box"), ("size", "64x48"))))
    assert [level for level, _ in busy.notifier.told] == ["warning", "warning"]
    assert "which Scan first is using" in busy.notifier.told[-1][1]
    assert (links, state.choice.value, state.devices.value) == ([], TWIN, devices)
    busy.gate.set()
    qtbot.waitUntil(busy.is_idle)
    rig.disconnect()
    qtbot.waitUntil(busy.is_idle)
    assert (state.link.value, busy.closed) == (Link.CLOSED, [devices])


def test_a_rig_that_something_else_takes_after_the_live_view_stays_connected(
    qtbot: QtBot, busy: Busy
) -> None:
    rig, state = busy.rig, busy.rig.state
    devices = state.devices.value
    rig.start_live(look)
    busy.hold()
    rig.disconnect()
    rig.connect(TWIN)
    assert state.link.value is Link.OPENING
    rig.connect(TWIN)
    qtbot.waitUntil(lambda: len(busy.notifier.told) >= 2)
    assert [text.split(" needs")[0] for _, text in busy.notifier.told] == ["Disconnect", "Connect twin"]
    assert (state.link.value, state.devices.value, busy.closed) == (Link.OPEN, devices, [])


def test_disconnecting_twice_while_the_live_view_stops_is_once(qtbot: QtBot, busy: Busy) -> None:
    rig, state = busy.rig, busy.rig.state
    devices = state.devices.value
    rig.start_live(look)
    rig.disconnect()
    rig.disconnect()
    qtbot.waitUntil(lambda: busy.closed == [devices] and busy.is_idle())
    assert (state.link.value, busy.notifier.told) == (Link.CLOSED, [])


def test_a_change_that_is_cancelled_before_it_begins_changes_nothing(qtbot: QtBot, busy: Busy) -> None:
    rig, state = busy.rig, busy.rig.state
    devices = state.devices.value
    changes: tuple[Callable[[], object], ...] = (lambda: rig.connect(TWIN), rig.disconnect)
    for change in changes:
        # Every thread has something to do, so that the change waits.
        others = [Job("Other", busy._work) for _ in range(WORKERS)]
        for other in others:
            busy.runner.submit(other)
        change()
        assert state.devices.value is None
        busy.runner.active[-1].cancel()
        busy.gate.set()
        qtbot.waitUntil(busy.is_idle)
        busy.gate.clear()
        assert (state.link.value, state.devices.value, busy.closed) == (Link.OPEN, devices, [])


def test_a_lost_rig_that_does_not_answer_is_closed_again_and_stays_lost(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    rig, notifier = controller()
    rig.connect(TWIN)
    rig.lose("The camera sent no frame.")
    assert (rig.state.link.value, rig.state.trouble.value) == (Link.LOST, "The camera sent no frame.")
    closed: list[DeviceRig] = []
    done: list[str] = []

    def close(devices: DeviceRig) -> None:
        closed.append(devices)
        raise DeviceError("The camera cannot be reached.")

    def gone(self: SimCamera, timeout_ms: float = 0.0) -> Frame:
        raise DeviceError("Check its cable.")

    monkeypatch.setattr(DeviceRig, "close", close)
    with monkeypatch.context() as away:
        away.setattr(SimCamera, "snap", gone)
        rig.reconnect(TWIN, lambda: done.append("there"), done.append)
    assert (rig.state.link.value, rig.state.devices.value) == (Link.LOST, None)
    # The one that was lost, and the one that was opened and did not answer.
    assert len(closed) == 2
    assert closed[0] is not closed[1]
    rig.reconnect(TWIN, lambda: done.append("there"), done.append)
    assert done == ["Check its cable.", "there"]
    assert (rig.state.link.value, rig.state.trouble.value) == (Link.OPEN, "")
    assert not notifier.told


def test_there_is_nothing_to_measure_with_from_a_loss_until_the_next_connection() -> None:
    rig, _ = controller()
    rig.connect(TWIN)
    assert rig.state.usable.value is rig.state.devices.value is not None
    rig.lose("The camera sent no frame.")
    assert rig.state.usable.value is None
    rig.connect(TWIN)
    assert rig.state.usable.value is rig.state.devices.value is not None


def test_devices_that_do_not_close_keep_nobody_from_another_rig(monkeypatch: pytest.MonkeyPatch) -> None:
    rig, _ = controller()
    rig.connect(TWIN)

    def close(devices: DeviceRig) -> None:
        raise DeviceError("The camera cannot be reached.")

    monkeypatch.setattr(DeviceRig, "close", close)
    rig.connect(TWIN)
    assert rig.state.link.value is Link.OPEN


def test_a_job_waits_for_the_live_view_to_stop(qtbot: QtBot, busy: Busy) -> None:
    rig = busy.rig
    rig.start_live(look)
    states: list[bool] = []
    done: list[str] = []
    rig.run(Job("Scan", lambda progress: states.append(rig.state.live.value), lambda _: done.append("scan")))
    qtbot.waitUntil(lambda: done == ["scan"])
    assert states == [False]
