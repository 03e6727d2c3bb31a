from __future__ import annotations

import threading
from collections.abc import Iterator
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from dsl_app.connection.controller import RigController
from dsl_app.connection.state import Link, RigChoice, RigState
from dsl_app.rig.controller import LiveController
from dsl_app.rig.options_form import parse_options
from dsl_app.rig.page import ExposureBox, RigPage
from dsl_app.rig.state import LOST_PICTURE, NO_RIG, WAITING, cycles_text
from dsl_app.shared.jobs.qt_runner import QtRunner
from dsl_app.shared.theme import LIGHT
from PySide6.QtCore import QPoint, QPointF, Qt
from PySide6.QtGui import QWheelEvent
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QPushButton
from pytestqt.qtbot import QtBot

from dsl_core.errors import DeviceError
from dsl_core.model.frames import Frame
from dsl_core.simulation.sim_devices import SimCamera
from tests.app.support.doubles import RecordingNotifier

Bench = tuple[RigPage, RigState, QtRunner, RecordingNotifier]


@pytest.fixture
def bench(qtbot: QtBot) -> Iterator[Bench]:
    state = RigState(RigChoice("twin", (("scene", "plane"), ("size", "64x48"))))
    runner, notifier = QtRunner(), RecordingNotifier()
    page = RigPage(LiveController(RigController(state, runner, notifier), notifier), ["replay", "twin"])
    qtbot.addWidget(page)
    page.apply_theme(LIGHT)
    page.show()
    yield page, state, runner, notifier
    page.release()
    runner.shut_down()


def click(button: QPushButton) -> None:
    QTest.mouseClick(button, Qt.MouseButton.LeftButton)


def connect(qtbot: QtBot, page: RigPage, state: RigState) -> None:
    click(page.connect_button)
    qtbot.waitUntil(lambda: state.link.value is Link.OPEN, timeout=90_000)


def test_connect_look_and_leave(qtbot: QtBot, bench: Bench) -> None:
    page, state, runner, _ = bench
    assert not page.live_button.isEnabled()
    connect(qtbot, page, state)
    assert "64 × 48" in page.camera_text.text()
    qtbot.waitUntil(lambda: page.live.content._rate.text().endswith("frames/s"), timeout=90_000)
    assert page.live_button.text() == "Stop live view"
    click(page.live_button)
    qtbot.waitUntil(lambda: not state.live.value)
    click(page.connect_button)
    qtbot.waitUntil(lambda: runner.active == ())
    assert page.camera_text.text() == "–"


def test_the_page_says_that_the_first_picture_is_on_its_way(
    qtbot: QtBot, bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    page, state, _, _ = bench
    may_look, snap = threading.Event(), SimCamera.snap

    def slowly(self: SimCamera, timeout_ms: float = 5000.0) -> Frame:
        may_look.wait()
        return snap(self, timeout_ms)

    monkeypatch.setattr(SimCamera, "snap", slowly)
    empty = page.live.content.note
    assert empty.text() == NO_RIG
    connect(qtbot, page, state)
    qtbot.waitUntil(lambda: state.live.value)
    assert empty.text() == WAITING
    may_look.set()
    qtbot.waitUntil(empty.isHidden, timeout=90_000)


def test_the_last_picture_of_a_lost_camera_says_that_it_is_old(
    qtbot: QtBot, bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    page, state, _, _ = bench
    connect(qtbot, page, state)
    live = page.live.content
    qtbot.waitUntil(live.note.isHidden, timeout=90_000)

    def pulled(self: SimCamera, timeout_ms: float = 5000.0) -> Frame:
        raise DeviceError("The camera was unplugged.")

    monkeypatch.setattr(SimCamera, "snap", pulled)
    qtbot.waitUntil(lambda: state.link.value is Link.LOST, timeout=90_000)
    qtbot.waitUntil(lambda: not state.live.value)
    assert (live.note.text(), live.note.isVisibleTo(live)) == (LOST_PICTURE, True)
    assert live._item.image is not None
    assert live._rate.text() == ""


def test_connecting_projects_what_the_panel_names_and_exposes_for_it(qtbot: QtBot, bench: Bench) -> None:
    page, state, _, notifier = bench
    connect(qtbot, page, state)
    devices = state.devices.value
    assert devices is not None
    assert page.projector._kind.currentText() == "White"
    assert (devices.projector.world.image == 204).all()  # type: ignore[attr-defined]
    # So much light saturates any exposure, so it is dimmed, and the panel says so.
    qtbot.waitUntil(lambda: bool(notifier.told), timeout=90_000)
    assert notifier.told[-1][1].startswith("Exposed for ")
    level = page.projector._level.value()
    assert 0.05 < level < 0.8
    drive = round(255 * level)
    assert (devices.projector.world.image == drive).all()  # type: ignore[attr-defined]
    frame = page._live_state.frame.value
    assert frame is not None
    assert 1000 < np.quantile(frame.pixels, 0.99) < 4095
    # A screen that is chosen later is black until it is told what to show.
    devices.projector.world.image = np.zeros_like(devices.projector.world.image)  # type: ignore[attr-defined]
    page.projector.screen_chosen.emit("")
    qtbot.waitUntil(lambda: bool((devices.projector.world.image == drive).all()))  # type: ignore[attr-defined]


def test_the_camera_rests_while_another_page_is_open(qtbot: QtBot, bench: Bench) -> None:
    page, state, _, notifier = bench
    connect(qtbot, page, state)
    qtbot.waitUntil(lambda: bool(notifier.told), timeout=90_000)
    page.hide()
    qtbot.waitUntil(lambda: not state.live.value)
    page.show()
    qtbot.waitUntil(lambda: state.live.value)
    click(page.live_button)
    qtbot.waitUntil(lambda: not state.live.value)
    page.hide()
    page.show()
    assert not state.live.value


def test_a_search_for_the_exposure_that_was_left_is_made_on_return(qtbot: QtBot, bench: Bench) -> None:
    page, state, _, notifier = bench
    connect(qtbot, page, state)
    qtbot.waitUntil(lambda: page._live_state.is_exposing.value, timeout=90_000)
    page.hide()
    qtbot.waitUntil(lambda: not state.live.value)
    assert not notifier.told
    page.show()
    qtbot.waitUntil(lambda: bool(notifier.told), timeout=90_000)
    assert notifier.told[-1][1].startswith("Exposed for ")
    frame = page._live_state.frame.value
    assert frame is not None
    assert np.quantile(frame.pixels, 0.99) < 4095


def test_a_wrong_option_is_told_on_the_page(qtbot: QtBot, bench: Bench) -> None:
    page, _, _, notifier = bench
    page.options.text.setText("scene=moon")
    click(page.connect_button)
    qtbot.waitUntil(lambda: bool(notifier.told))
    assert "moon" in page.trouble.text()
    assert page.trouble.isVisible()
    assert page.connect_button.text() == "Connect"


def test_typed_options_are_not_shown_as_if_they_were_connected(qtbot: QtBot, bench: Bench) -> None:
    page, state, _, _ = bench
    connect(qtbot, page, state)
    assert page.connect_button.text() == "Disconnect"
    page.options.text.setText("size=32x24")
    assert page.connect_button.text() == "Connect"
    page.options.text.clear()
    assert page.connect_button.text() == "Disconnect"
    page.options.text.setText("size=32x24")
    QTest.keyClick(page.options.text, Qt.Key.Key_Return)
    qtbot.waitUntil(lambda: page.camera_text.text().endswith("32 × 24 px"), timeout=90_000)
    assert page.connect_button.text() == "Disconnect"


def test_pictures_reach_the_projector(qtbot: QtBot, bench: Bench) -> None:
    page, state, _, _ = bench
    connect(qtbot, page, state)
    panel = page.projector
    panel._kind.setCurrentIndex(panel._kind.findData("line"))
    panel._column.setValue(100)
    devices = state.devices.value
    assert devices is not None
    world = devices.projector.world  # type: ignore[attr-defined]

    def shown() -> list[int]:
        return [] if world.image is None else world.image[0, 99:106, 0].tolist()

    qtbot.waitUntil(lambda: shown() == [0, 204, 204, 204, 204, 204, 0])


def test_the_line_wanders_and_stops(qtbot: QtBot, bench: Bench) -> None:
    page, state, _, _ = bench
    connect(qtbot, page, state)
    page.projector._column.setValue(page.projector._column.maximum())
    page.projector._step()
    assert page.projector._column.value() == 0


def test_the_wheel_changes_nothing_without_focus(qtbot: QtBot, bench: Bench) -> None:
    page, state, _, _ = bench
    connect(qtbot, page, state)
    before = page.exposure.value()
    page.options.text.setFocus()
    spot = QPointF(5, 5)
    wheel = QWheelEvent(
        spot, page.exposure.mapToGlobal(spot), QPoint(0, 0), QPoint(0, 120), Qt.MouseButton.NoButton,
        Qt.KeyboardModifier.NoModifier, Qt.ScrollPhase.NoScrollPhase, False,
    )  # fmt: skip
    QApplication.sendEvent(page.exposure, wheel)
    assert page.exposure.value() == before


@pytest.mark.parametrize("cycle_ms", [1000 / 60, 16.6683, 1000 / 24])
def test_steps_of_the_exposure_stay_on_whole_cycles(
    bench: Bench, monkeypatch: pytest.MonkeyPatch, cycle_ms: float
) -> None:
    page, _, _, _ = bench
    box = page.exposure
    monkeypatch.setattr(RigState, "cycle_ms", cycle_ms)
    box.setValue(10 * cycle_ms + 1)
    shown = []
    for step in 8 * [box.stepUp] + 12 * [box.stepDown]:
        step()
        shown.append(cycles_text(page._live_state.exposure_ms.value, cycle_ms))
    cycles = [*range(11, 19), *range(17, 5, -1)]
    assert shown == [f"{each} LED cycles" for each in cycles]


@pytest.mark.parametrize(
    ("shortest_ms", "typed", "exposure_ms", "text"),
    [
        (0.01, "0.025", 0.025, "0.025 ms"),
        (0.004, "0.004", 0.004, "0.0040 ms"),
        (1.0, "16.67", 16.67, "16.67 ms"),
    ],
)
def test_an_exposure_is_shown_as_fine_as_the_camera_sets_it(
    qtbot: QtBot, bench: Bench, shortest_ms: float, typed: str, exposure_ms: float, text: str
) -> None:
    page, state, _, _ = bench
    connect(qtbot, page, state)
    devices, box = state.devices.value, page.exposure
    assert devices is not None
    click(page.live_button)
    qtbot.waitUntil(lambda: not state.live.value)
    page._live_state.exposure_ms.set(100 / 3)
    info = replace(devices.camera.info, exposure_range_ms=(shortest_ms, 50.0))
    camera = SimpleNamespace(info=info, close=devices.camera.close)
    state.devices.set(replace(devices, camera=camera))  # type: ignore[arg-type]
    assert page._live_state.exposure_ms.value == 100 / 3
    box.selectAll()
    QTest.keyClicks(box, typed)
    QTest.keyClick(box, Qt.Key.Key_Return)
    assert (page._live_state.exposure_ms.value, box.text()) == (exposure_ms, text)


def test_the_page_names_its_command(bench: Bench) -> None:
    page, _, _, _ = bench
    assert page.command_line() == "dsl-scan selftest --rig twin --option scene=plane --option size=64x48"


def test_options_as_people_type_them() -> None:
    assert parse_options(" scene=box  film=off noise ") == (
        ("scene", "box"),
        ("film", "off"),
        ("noise", "on"),
    )


def test_a_region_limits_figures_and_exposure(qtbot: QtBot, bench: Bench) -> None:
    page, state, _, notifier = bench
    connect(qtbot, page, state)
    qtbot.waitUntil(lambda: bool(notifier.told), timeout=90_000)
    notifier.told.clear()
    assert not page.live.content.rectangle.isVisible()
    page.live.content.region_box.click()
    region = page.live.content.region
    assert region is not None
    x, y, width, height = region
    assert (x % 2, y % 2, width % 2, height % 2) == (0, 0, 0, 0)
    assert 0 < width < 64
    assert 0 < height < 48
    page.live.content.rectangle.setPos(-20, -20)
    moved = page.live.content.region
    assert moved is not None
    assert moved[:2] == (0, 0)
    page.live.content.rectangle.setPos(0, 0)
    click(page.auto)
    qtbot.waitUntil(lambda: bool(notifier.told), timeout=90_000)
    assert "LED cycle" in page.cycles.text()
    assert "vary" not in page.cycles.text()
    assert page.auto.isEnabled()


def test_raw_counts_are_read_by_keys_too(qtbot: QtBot, bench: Bench) -> None:
    page, state, _, _ = bench
    connect(qtbot, page, state)
    qtbot.waitUntil(lambda: page._live_state.frame.value is not None, timeout=90_000)
    click(page.live_button)
    qtbot.waitUntil(lambda: not state.live.value)
    QTest.keyClick(page.live.content, Qt.Key.Key_Right)
    QTest.keyClick(page.live.content, Qt.Key.Key_Up, Qt.KeyboardModifier.ShiftModifier)
    frame = page._live_state.frame.value
    assert frame is not None
    assert (
        page.live.content._pixel.text() == f"column 33 px, row 14 px: {frame.pixels[14, 33]} DN, green pixel"
    )
    QTest.keyClick(page.live.content, Qt.Key.Key_F)


def test_the_form_shows_a_rig_that_another_page_asked_for(bench: Bench) -> None:
    page, state, _, _ = bench
    assert page.options.options == (("scene", "plane"), ("size", "64x48"))
    assert page.options.text.text() == ""
    state.choice.set(RigChoice("replay", (("scan", "first.dsl"),)))
    assert page._rig.currentText() == "replay"
    assert page.options.text.text() == "scan=first.dsl"


@pytest.mark.parametrize("name", ["/rigs/of/a/laboratory/with/a/long/name/lab.json", "gone"])
def test_a_rig_that_is_not_in_the_list_is_shown_and_asked_for_by_its_name(bench: Bench, name: str) -> None:
    page, state, _, _ = bench
    state.choice.set(RigChoice(name, (("port", "3"),)))
    assert page._rig.currentData() == name
    assert page._choice == state.choice.value
    assert 0 < page._rig.minimumWidth() < 100, "a long path does not widen the column"


def test_a_scan_has_the_projector_for_itself(qtbot: QtBot, bench: Bench) -> None:
    page, state, _, notifier = bench
    connect(qtbot, page, state)
    panel = page.projector
    panel._loop.click()
    assert panel._timer.isActive()
    devices = state.devices.value
    assert devices is not None
    state.used_by.set("Scan first")
    assert not panel._timer.isActive()
    assert not panel._loop.isChecked()
    controls = (
        panel._kind, panel._level, panel._column, panel._slider, panel._loop, panel._screen, panel._identify,
    )  # fmt: skip
    assert not any(widget.isEnabled() for widget in controls)
    assert panel._note.text() == "Scan first is using the projector. Pictures can be shown when it has ended."
    state.used_by.set("")
    assert all(widget.isEnabled() for widget in controls)
    assert "640 × 360" in panel._note.text()
    assert not notifier.told


def test_a_scene_chosen_during_a_scan_is_not_shown_as_if_it_were_connected(
    qtbot: QtBot, bench: Bench
) -> None:
    page, state, _, _ = bench
    connect(qtbot, page, state)
    connected = state.choice.value
    state.used_by.set("Scan first")
    scene = page.options.scene
    for name, button in (("face", "Connect"), ("plane", "Disconnect"), ("face", "Connect")):
        scene.fill()
        scene.choose(name)
        scene.activated.emit(scene.currentIndex())
        assert state.choice.value == connected
        assert page.connect_button.text() == button
    state.used_by.set("")
    assert page.connect_button.text() == "Connect"
    click(page.connect_button)
    qtbot.waitUntil(lambda: dict(state.choice.value.options)["scene"] == "face", timeout=90_000)
    qtbot.waitUntil(lambda: page.connect_button.text() == "Disconnect", timeout=90_000)


@pytest.mark.parametrize(
    ("cycle_ms", "most_ms", "start_ms", "up_ms", "down_ms"),
    [
        (1000 / 24, 3e4, 60.0, 83.333, 41.667),
        (1000 / 24, 3e4, 65.0, 83.333, 41.667),
        (1000 / 24, 3e4, 1000 / 24, 83.333, 33.333),
        (1000 / 24, 30.0, 10.0, 12.5, 8.0),
        (1.0, 5.0, 1.5, 2.0, 1.0),
        (1.0, 5.0, 0.01, 1.0, 0.009),
    ],
)
def test_steps_of_the_exposure_miss_no_cycle_and_have_shares_below_the_first(
    qtbot: QtBot, cycle_ms: float, most_ms: float, start_ms: float, up_ms: float, down_ms: float
) -> None:
    box = ExposureBox("Exposure", 0.001, most_ms, start_ms, "ms", 3, "")
    qtbot.addWidget(box)
    box.setSingleStep(cycle_ms)
    for steps, wanted in ((1, up_ms), (-1, down_ms)):
        box.setValue(start_ms)
        box.stepBy(steps)
        assert box.value() == pytest.approx(wanted, abs=0.0011)
