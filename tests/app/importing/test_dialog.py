"""Import by mouse: a folder is dropped, looked at, taken in and opened."""

from __future__ import annotations

from pathlib import Path

import pytest
from dsl_app.composition.window import Composition, StartOptions
from dsl_app.importing.dialog import ImportDialog
from dsl_app.shared.widgets.open_dialog import OpenDialog
from dsl_app.shell.main_window import MainWindow
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QFileDialog, QPlainTextEdit
from pytestqt.qtbot import QtBot

from dsl_core.io.calibration_library import CalibrationLibrary
from dsl_core.io.published.calibration import export_calibration
from dsl_core.io.rig_file import load_rig
from tests.app.composition.test_drops import drop
from tests.app.composition.test_names import complaints
from tests.app.importing.published_folders import Folders, make_folders
from tests.app.support.real_window import show_window

PATIENCE_MS = 60_000


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Folders:
    """To be read only."""
    return make_folders(tmp_path_factory.mktemp("published"))


@pytest.fixture
def window(qtbot: QtBot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> MainWindow:
    monkeypatch.setenv("DSL_SCAN_HOME", str(tmp_path / "home"))
    # What is still read when the window closes is not asked about.
    monkeypatch.setattr("dsl_app.shell.paged_window.confirm", lambda *_, **__: True)
    composition = Composition(StartOptions())
    made = composition.open_window(tmp_path / "home")
    made.parts.settings.output_folder = str(tmp_path / "scans")
    show_window(qtbot, made)
    return made


def opened(qtbot: QtBot, window: MainWindow) -> ImportDialog:
    found: list[ImportDialog] = []

    def look() -> bool:
        found[:] = [each for each in window.findChildren(ImportDialog) if each.isVisible()]
        return bool(found)

    qtbot.waitUntil(look, timeout=PATIENCE_MS)
    return found[0]


def texts(dialog: ImportDialog, column: int) -> list[str]:
    items = [dialog.table.item(row, column) for row in range(dialog.table.rowCount())]
    return [item.text().replace(chr(0x200B), "") for item in items if item is not None]


def test_a_dropped_scan_is_taken_in_and_offered(
    qtbot: QtBot, window: MainWindow, made: Folders, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert drop(window, made.scene)
    dialog = opened(qtbot, window)
    assert complaints(dialog) == []
    assert "entries are as published" in dialog._summary.text()
    assert "optional" in texts(dialog, 2)
    assert not dialog._size.isVisible()
    assert not dialog.go.isEnabled()
    monkeypatch.setattr(QFileDialog, "getOpenFileName", lambda *_: (str(made.own), ""))
    dialog.file.click()
    qtbot.waitUntil(lambda: dialog.go.isEnabled(), timeout=PATIENCE_MS)
    dialog.name.selectAll()
    QTest.keyClicks(dialog.name, "chart")
    assert dialog.text.text() == "Creates chart.dsl."
    QTest.mouseClick(dialog.go, Qt.MouseButton.LeftButton)
    target = tmp_path / "scans" / "chart.dsl"
    qtbot.waitUntil(lambda: window.page_of("results").subject() == target, timeout=PATIENCE_MS)
    assert window.page == "results"
    assert window.parts.settings.recent == [str(target)]


def test_a_calibration_ends_in_the_library(
    qtbot: QtBot, window: MainWindow, made: Folders, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(OpenDialog, "ask", lambda *_, **__: made.rig)
    window.do("import")
    dialog = opened(qtbot, window)
    assert dialog._size.isVisible()
    dialog.command.click()
    (text,) = dialog.findChildren(QPlainTextEdit)
    assert text.toPlainText().startswith(f"dsl-scan import {made.rig} -o ")
    QApplication.activeModalWidget().close()  # type: ignore[union-attr]
    QTest.mouseClick(dialog.go, Qt.MouseButton.LeftButton)
    qtbot.waitUntil(lambda: CalibrationLibrary().names() != (), timeout=PATIENCE_MS)
    assert window.page == "calibrate"


def test_doubts_about_a_calibration_are_shown_until_its_unit_is_right(
    qtbot: QtBot, window: MainWindow, made: Folders, tmp_path: Path
) -> None:
    own = load_rig(made.own)
    there = own.pose.model_copy(update={"translation_mm": tuple((own.pose.vector_mm / 1000).tolist())})
    export_calibration(own.model_copy(update={"pose": there}), tmp_path / "metres")
    window.open_path(tmp_path / "metres")
    dialog = opened(qtbot, window)
    assert complaints(dialog) == []
    assert "if its lengths are in metres, set their unit to 1000 mm." in dialog.text.text()
    assert not dialog.go.isEnabled()
    # Enter in the box of the unit must not lead to another folder.
    assert not dialog.other.isDefault()
    dialog.unit_mm.setValue(20)
    qtbot.waitUntil(dialog.doubts.isVisible, timeout=PATIENCE_MS)
    assert "the projector would be 1.25 mm from the camera" in dialog.doubts.text()
    dialog.unit_mm.setValue(1000)
    qtbot.waitUntil(lambda: dialog.go.isEnabled() and not dialog.doubts.isVisible(), timeout=PATIENCE_MS)
    window.open_path(made.rig)
    qtbot.waitUntil(lambda: dialog.name.text() == "rig", timeout=PATIENCE_MS)
    assert dialog.unit_mm.value() == 1
    assert dialog.go.isEnabled()
    dialog.reject()


def test_another_folder_is_shown_in_the_same_dialog(
    qtbot: QtBot, window: MainWindow, made: Folders, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    window.open_path(made.rig)
    dialog = opened(qtbot, window)
    (tmp_path / "empty").mkdir()
    (tmp_path / "empty" / "notes.txt").touch()
    monkeypatch.setattr(OpenDialog, "ask", lambda *_, **__: tmp_path / "empty")
    dialog.other.click()
    qtbot.waitUntil(lambda: "is not a published dataset" in dialog.text.text(), timeout=PATIENCE_MS)
    assert "ldr_exposure1/" in texts(dialog, 0)
    assert dialog.name.text() == "empty"
    assert not dialog.go.isEnabled()
    # Nothing else helps.
    assert dialog.other.property("role") == "primary"
    assert dialog.other.isDefault()
    monkeypatch.setattr(OpenDialog, "ask", lambda *_, **__: made.rig)
    dialog.other.click()
    qtbot.waitUntil(lambda: dialog.go.isEnabled(), timeout=PATIENCE_MS)
    assert dialog.other.property("role") == ""
    assert dialog.go.isDefault()
    dialog.reject()
