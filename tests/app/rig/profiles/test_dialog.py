"""A rig profile is made by mouse: found devices are chosen, tried and saved."""

from __future__ import annotations

import shlex
from pathlib import Path

import pytest
from dsl_app.composition.window import Composition, StartOptions
from dsl_app.rig.page import RigPage
from dsl_app.rig.profiles import controller
from dsl_app.rig.profiles.controller import ProfileController
from dsl_app.rig.profiles.dialog import ProfileDialog
from dsl_app.rig.profiles.draft import caption
from dsl_app.rig.profiles.state import Found, ProfileState, profile_view
from dsl_app.start.page import StartPage
from PySide6.QtCore import Qt, QTimer
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QMessageBox, QPushButton, QWidget
from pytestqt.qtbot import QtBot

from dsl_core.devices import doctor
from dsl_core.devices.doctor import Finding, Grade
from dsl_core.devices.driver_table import FoundDevice
from dsl_core.io.rig_profile import load_profile, profile_names, profiles_folder
from tests.app.support.doubles import InlineRunner
from tests.app.support.real_window import show_window

LEFT = Qt.MouseButton.LeftButton
WEBCAM = Found("camera", "uvc", FoundDevice({"index": 1}, "webcam 1"))


def is_blue(button: QPushButton) -> bool:
    return bool(button.property("role") == "primary")


class Bench:
    """The dialog alone; jobs run at once and a rig may be connected."""

    def __init__(self, qtbot: QtBot) -> None:
        self.state, self.is_connected = ProfileState(), False
        self.control = ProfileController(self.state, InlineRunner(), lambda: self.is_connected)
        self.parent = QWidget()
        qtbot.addWidget(self.parent)
        self.dialog = ProfileDialog(self.state, self.control, self.parent)
        self.dialog.show()

    def fill_in(self) -> None:
        """A webcam that was found, and no projector, by mouse and keys."""
        dialog = self.dialog
        QTest.mouseClick(dialog.look, LEFT)
        QTest.keyClicks(dialog.name, "bench")
        camera, projector = dialog.forms["camera"], dialog.forms["projector"]
        camera.found.setFocus()
        QTest.keyClick(camera.found, Qt.Key.Key_Down)
        projector.driver.setCurrentIndex(projector.driver.findData("none"))
        projector.driver.activated.emit(projector.driver.currentIndex())


@pytest.fixture
def bench(qtbot: QtBot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Bench:
    monkeypatch.setenv("DSL_SCAN_HOME", str(tmp_path))
    monkeypatch.setattr(controller, "find_devices", lambda _: (WEBCAM,))
    return Bench(qtbot)


def test_the_return_key_does_what_is_blue(bench: Bench) -> None:
    dialog = bench.dialog
    buttons = (dialog.look, dialog.test, dialog.save)
    QTest.keyClicks(dialog.name, "bench")
    QTest.keyClick(dialog.name, Qt.Key.Key_Return)
    assert bench.state.found.value == (WEBCAM,), "Return looked for devices"
    assert profile_names() == []
    bench.fill_in()
    assert [button.isDefault() for button in buttons] == [is_blue(button) for button in buttons]
    assert len({button.minimumHeight() for button in (dialog.look, dialog.test)}) == 1
    field = dialog.forms["camera"].fields["size_px"]
    assert field.accessibleName() == "Size (px)"


def test_a_profile_is_made_of_what_was_found_and_edited_again(bench: Bench) -> None:
    saved: list[Path] = []
    bench.state.saved.connect(saved.append)
    bench.fill_in()
    camera = bench.dialog.forms["camera"]
    assert camera.fields["index"].text() == "1"
    assert camera.fields["size_px"].placeholderText() == "640, 480"
    QTest.keyClicks(camera.fields["size_px"], "wide")
    QTest.mouseClick(bench.dialog.save, LEFT)
    assert bench.dialog.trouble.text() == "Size (px) must be values separated by commas."
    assert (profile_names(), bench.dialog.isVisible()) == ([], True)
    camera.fields["size_px"].clear()
    QTest.keyClicks(camera.fields["size_px"], "1280 x 720")
    QTest.mouseClick(bench.dialog.save, LEFT)
    assert not bench.dialog.isVisible()
    assert saved == [profiles_folder() / "bench.json"]
    assert load_profile(saved[0]).camera.settings == {"index": 1, "size_px": [1280, 720]}
    bench.control.open(saved[0])
    bench.control.change(note="by the window")
    assert bench.control.save()
    assert load_profile(saved[0]).note == "by the window"
    bench.control.open(None)
    bench.control.change(name="bench")
    bench.control.choose_device(WEBCAM)
    bench.control.set_driver("projector", "none")
    assert not bench.control.save()
    assert "already. Enter another name" in bench.state.trouble.value


def test_trying_says_beside_the_fields_what_works(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    said = [Finding("camera uvc", Grade.GOOD, "640 x 480 px"), Finding("projector none", Grade.BAD, "None.")]
    monkeypatch.setattr(doctor, "examine", lambda profile, nominal: said)
    QTest.mouseClick(bench.dialog.save, LEFT)
    assert "The rig has no name" in bench.dialog.trouble.text()
    bench.fill_in()
    bench.is_connected = True
    QTest.mouseClick(bench.dialog.test, LEFT)
    assert "Disconnect it" in bench.dialog.trouble.text()
    bench.is_connected = False
    QTest.mouseClick(bench.dialog.test, LEFT)
    texts = [bench.dialog.findings.item(row, 1) for row in range(bench.dialog.findings.rowCount())]
    assert [item.text() for item in texts if item is not None] == ["640 x 480 px", "None."]
    assert bench.dialog.verdict.text() == "1 of 2 findings prevent a scan."
    bench.control.change(note="new")
    assert profile_view(bench.state).verdict.startswith("Before the last change: 1 of 2")


def test_the_blue_button_leads_from_name_to_look_try_and_save(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    def blue() -> list[str]:
        dialog = bench.dialog
        return [each.text() for each in (dialog.look, dialog.test, dialog.save) if is_blue(each)]

    monkeypatch.setattr(
        doctor, "examine", lambda profile, nominal: [Finding("camera uvc", Grade.GOOD, "640 px")]
    )
    found = bench.dialog.forms["camera"].found
    assert bench.dialog.focusWidget() is bench.dialog.name
    assert (found.currentText(), blue()) == ("not looked for yet", ["&Look for devices"])
    bench.fill_in()
    assert bench.dialog.forms["stage"].found.currentText() == "nothing found"
    assert blue() == ["&Try"]
    QTest.mouseClick(bench.dialog.test, LEFT)
    assert blue() == ["Save"]
    bench.control.change(note="new")
    assert blue() == ["&Try"]


def test_what_is_wrong_with_a_setting_stands_below_its_field_until_it_is_right(bench: Bench) -> None:
    bench.fill_in()
    dialog, camera = bench.dialog, bench.dialog.forms["camera"]
    QTest.keyClicks(camera.fields["size_px"], "wide")
    dialog.tabs.setCurrentWidget(dialog.forms["stage"])
    QTest.mouseClick(dialog.test, LEFT)
    assert dialog.tabs.currentWidget() is camera
    note = camera.notes["size_px"]
    assert note.text() == "Must be values separated by commas. Width and height of its pictures."
    assert (note.property("role"), camera.notes["index"].property("role")) == ("bad", "muted")
    camera.fields["size_px"].clear()
    QTest.keyClicks(camera.fields["size_px"], "640, 480")
    assert (note.text(), note.property("role")) == ("Width and height of its pictures", "muted")


def test_devices_are_tried_without_a_name_and_with_their_data_sheets(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(
        doctor, "examine", lambda profile, nominal: [Finding("camera uvc", Grade.GOOD, "640 px")]
    )
    bench.fill_in()
    bench.control.change(name="", nominal="nowhere.json")
    QTest.mouseClick(bench.dialog.test, LEFT)
    assert [each.device for each in bench.state.findings.value] == ["camera uvc", "data sheets"]
    # What prevents a scan is not saved next, but tried again.
    assert is_blue(bench.dialog.test)


def test_who_finds_nothing_is_told_what_to_do(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    QTest.mouseClick(bench.dialog.look, LEFT)
    # A camera was found: it is chosen next, not looked for again.
    assert not is_blue(bench.dialog.look)
    assert bench.dialog.trouble.text().startswith("No projector was found. Check cables")
    monkeypatch.setattr(controller, "find_devices", lambda _: ())
    QTest.mouseClick(bench.dialog.look, LEFT)
    assert is_blue(bench.dialog.look)
    assert "No camera and no projector was found" in bench.dialog.trouble.text()


def test_defaults_are_shown_as_a_person_writes_them(bench: Bench) -> None:
    bench.fill_in()
    assert bench.dialog.forms["projector"].fields["frame_period_ms"].placeholderText() == "16.6667"


def test_a_profile_that_cannot_be_read_is_said(bench: Bench, tmp_path: Path) -> None:
    (tmp_path / "broken.json").write_text("{")
    bench.control.open(tmp_path / "broken.json")
    assert "not JSON" in bench.dialog.trouble.text()


@pytest.mark.parametrize("drops", [False, True])
def test_escape_asks_before_it_drops_what_was_typed(bench: Bench, qtbot: QtBot, drops: bool) -> None:
    dialog, asked = bench.dialog, []

    def answer() -> None:
        box = QApplication.activeModalWidget()
        assert isinstance(box, QMessageBox)
        asked.append(box.text())
        name = "Close unsaved" if drops else "Keep editing"
        QTest.mouseClick(next(each for each in box.buttons() if each.text() == name), LEFT)

    QTest.keyClicks(dialog.name, "x")
    QTimer.singleShot(0, answer)
    QTest.keyClick(dialog.name, Qt.Key.Key_Escape)
    assert len(asked) == 1
    assert dialog.isVisible() is not drops
    if not drops:
        # As it was opened, there is nothing to lose.
        dialog.name.clear()
        bench.control.change(name="")
        QTest.keyClick(dialog.name, Qt.Key.Key_Escape)
        assert not dialog.isVisible()


def test_captions_have_the_unit() -> None:
    assert [caption(name) for name in ("latency_ms", "size_px", "target_at_zero_mm", "port")] == [
        "Latency (ms)",
        "Size (px)",
        "Target at zero (mm)",
        "Port",
    ]


def test_a_saved_profile_is_chosen_on_the_rig_page(
    qtbot: QtBot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("DSL_SCAN_HOME", str(tmp_path))
    window = Composition(StartOptions()).open_window(tmp_path)
    show_window(qtbot, window)
    page = window.open_page("rig")
    assert isinstance(page, RigPage)
    assert not page.edit_profile.isEnabled()
    QTest.mouseClick(page.new_profile, LEFT)
    (dialog,) = window.findChildren(ProfileDialog)
    dialog._commands.change(name="room 12")
    dialog._commands.choose_device(WEBCAM)
    dialog._commands.set_driver("projector", "none")
    QTest.mouseClick(dialog.save, LEFT)
    assert page.edit_profile.isEnabled()
    QTest.mouseClick(page.edit_profile, LEFT)
    again = [each for each in window.findChildren(ProfileDialog) if each.isVisible()]
    assert [each.name.text() for each in again] == ["room 12"]
    again[0].reject()
    window.close()


@pytest.mark.parametrize("has_rig", [False, True])
def test_who_wants_to_connect_a_first_rig_begins_with_its_profile(
    qtbot: QtBot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, has_rig: bool
) -> None:
    monkeypatch.setenv("DSL_SCAN_HOME", str(tmp_path))
    if has_rig:
        profiles_folder().mkdir(parents=True)
        (profiles_folder() / "bench.json").write_text("{}")
    window = Composition(StartOptions()).open_window(tmp_path)
    qtbot.addWidget(window)
    window.show()
    start = window.open_page("start")
    assert isinstance(start, StartPage)
    QTest.mouseClick(start.connect_rig, LEFT)
    assert window.page == "rig"
    assert bool(window.findChildren(ProfileDialog)) is not has_rig


def test_the_command_names_a_profile_whose_name_has_spaces(qtbot: QtBot) -> None:
    bench = Bench(qtbot)
    bench.control.open(None)
    bench.control.change(name="room 12")
    command = shlex.split(bench.control.command_line())
    assert command[:3] == ["dsl-scan", "rigs", "doctor"]
    assert Path(command[3]).stem == "room 12"
    assert len(command) == 4
