"""Captures by mouse: a folder is dropped, its guess is corrected and saved, and a scan is made of it."""

from __future__ import annotations

from pathlib import Path

import pytest
from dsl_app.composition.window import Composition, StartOptions
from dsl_app.importing.captures.controller import CapturesController
from dsl_app.importing.captures.dialog import CapturesDialog
from dsl_app.importing.captures.state import NOMINAL, CapturesState
from dsl_app.importing.dialog import ImportDialog
from dsl_app.shared.widgets.open_dialog import OpenDialog
from dsl_app.shell.main_window import MainWindow
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import (
    QAbstractButton,
    QAbstractSpinBox,
    QApplication,
    QComboBox,
    QFileDialog,
    QLineEdit,
    QPlainTextEdit,
    QSpinBox,
    QWidget,
)
from pytestqt.qtbot import QtBot

from dsl_core.io.scan.folder import ScanReader
from dsl_core.workflows.captures import load_mapping
from tests.app.composition.test_drops import drop
from tests.app.composition.test_names import complaints
from tests.app.importing.captures.small_capture import make_capture
from tests.app.support.doubles import InlineRunner
from tests.app.support.real_window import show_window

PATIENCE_MS = 60_000
LEFT = Qt.MouseButton.LeftButton


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """To be read only."""
    return make_capture(tmp_path_factory.mktemp("capture") / "set")


@pytest.fixture
def window(qtbot: QtBot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> MainWindow:
    monkeypatch.setenv("DSL_SCAN_HOME", str(tmp_path / "home"))
    made = Composition(StartOptions()).open_window(tmp_path / "home")
    made.parts.settings.output_folder = str(tmp_path / "scans")
    show_window(qtbot, made)
    return made


def opened(qtbot: QtBot, window: MainWindow) -> CapturesDialog:
    found: list[CapturesDialog] = []

    def look() -> bool:
        found[:] = [each for each in window.findChildren(CapturesDialog) if each.isVisible()]
        return bool(found)

    qtbot.waitUntil(look, timeout=PATIENCE_MS)
    settle(qtbot, found[0])
    return found[0]


def settle(qtbot: QtBot, dialog: CapturesDialog) -> None:
    qtbot.waitUntil(lambda: not dialog._state.busy.value, timeout=PATIENCE_MS)


@pytest.mark.slow
def test_dropped_pictures_are_corrected_by_mouse_and_become_a_scan(
    qtbot: QtBot, window: MainWindow, folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert drop(window, folder)
    dialog = opened(qtbot, window)
    assert complaints(dialog) == []
    # A laptop of 1280 x 800 px at one and a half times the size has no more, less the frame of a window.
    assert dialog.minimumSizeHint().height() <= 493
    assert (dialog.width(), dialog.height()) <= (1024, 700)
    assert "mapping guessed" in dialog.about_folder.text()
    assert "of the lit pixels have a column" in dialog.about_columns.text()
    first = dialog.files.item(0, 0)
    assert first is not None
    assert not first.icon().isNull()
    # The code has one digit more than there are pictures of.
    stripes = next(i for i in range(3) if "gray" in dialog.editor.parts.item(i).text())
    spot = dialog.editor.parts.visualItemRect(dialog.editor.parts.item(stripes)).center()
    QTest.mouseClick(dialog.editor.parts.viewport(), LEFT, pos=spot)
    bits = dialog.editor.part.controls["bits"]
    assert isinstance(bits, QSpinBox)
    bits.setFocus()
    QTest.keyClick(bits, Qt.Key.Key_Up)
    settle(qtbot, dialog)
    assert "12 pictures where the mapping wants 14" in dialog.about_mapping.text()
    assert dialog.about_mapping.alignment() & Qt.AlignmentFlag.AlignTop, "a long one begins where it is read"
    assert not dialog.go.isEnabled()
    assert dialog.decoded.words.text() == "Nothing can be decoded yet."
    QTest.keyClick(bits, Qt.Key.Key_Down)
    settle(qtbot, dialog)
    assert dialog.go.isEnabled()
    file = tmp_path / "m.json"
    monkeypatch.setattr(QFileDialog, "getSaveFileName", lambda *_: (str(file.with_suffix("")), ""))
    QTest.mouseClick(dialog.save, LEFT)
    assert load_mapping(file).parts[stripes].kind == "stripes"
    dialog.height_px.setValue(0)
    assert (dialog.width_px.value(), dialog.height_px.value()) == load_mapping(file).projector_size_px
    QTest.mouseClick(dialog.command, LEFT)
    (text,) = dialog.findChildren(QPlainTextEdit)
    assert f"--mapping {file}" in text.toPlainText()
    QApplication.activeModalWidget().close()  # type: ignore[union-attr]
    dialog.name.selectAll()
    QTest.keyClicks(dialog.name, "box")
    QTest.mouseClick(dialog.go, LEFT)
    target = tmp_path / "scans" / "box.dsl"
    qtbot.waitUntil(lambda: window.page == "results", timeout=PATIENCE_MS)
    assert not ScanReader(target).missing()
    assert any("have a column" in toast.text for toast in window.toasts.shown)


@pytest.mark.slow
def test_a_wrong_folder_and_calibration_are_said_beside_them(
    qtbot: QtBot, window: MainWindow, folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(OpenDialog, "ask", lambda *_, **__: folder)
    QTest.mouseClick(window.page_of("start").captures, LEFT)  # type: ignore[attr-defined]
    dialog = opened(qtbot, window)
    monkeypatch.setattr(OpenDialog, "ask", lambda *_, **__: tmp_path)
    QTest.mouseClick(dialog.choose, LEFT)
    settle(qtbot, dialog)
    assert "contains 0 pictures" in dialog.about_folder.text()
    assert not dialog.go.isEnabled()
    dialog.open_folder(folder)
    settle(qtbot, dialog)
    QTest.keyClick(dialog.calibration, Qt.Key.Key_Down)
    settle(qtbot, dialog)
    assert dialog._state.request.value.calibration == NOMINAL
    assert "The pictures are 64 × 48 px" in dialog.about_calibration.text()
    assert dialog.about_calibration.property("role") == "bad"
    QTest.keyClick(dialog, Qt.Key.Key_Escape)
    assert not dialog.isVisible()


@pytest.mark.slow
def test_import_opens_the_dialog_that_fits_the_folder(
    qtbot: QtBot, window: MainWindow, folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "empty").mkdir()
    (tmp_path / "empty" / "notes.txt").touch()
    answers = [tmp_path / "empty", folder.parent]
    monkeypatch.setattr(OpenDialog, "ask", lambda *_, **__: answers.pop(0))
    window.do("import")
    published: list[ImportDialog] = []

    def is_open() -> bool:
        published[:] = [each for each in window.findChildren(ImportDialog) if each.isVisible()]
        return bool(published)

    qtbot.waitUntil(is_open, timeout=PATIENCE_MS)
    QTest.mouseClick(published[0].other, Qt.MouseButton.LeftButton)
    dialog = opened(qtbot, window)
    assert dialog._state.request.value.folder == folder.parent
    assert not is_open()
    dialog.reject()


def test_all_that_would_change_an_import_rests_while_it_runs(
    qtbot: QtBot, folder: Path, tmp_path: Path
) -> None:
    state, host = CapturesState(tmp_path / "scans"), QWidget()
    qtbot.addWidget(host)
    dialog = CapturesDialog(state, CapturesController(state, InlineRunner()), host)
    dialog.open_folder(folder)
    kinds = (QAbstractButton, QComboBox, QLineEdit, QAbstractSpinBox)
    parts = [each for kind in kinds for each in dialog.findChildren(kind)]
    assert {dialog.go, dialog.calibration, dialog.home, dialog.curves} <= {*parts}
    state.is_importing.set(True)
    # What is left closes the dialog, shows the command, or selects what the table shows.
    others = (dialog.buttons, dialog.files)
    kept = [each for each in parts if each.isEnabled() and each.parent() not in others]
    assert kept == []
    state.is_importing.set(False)
    assert dialog.calibration.isEnabled()
    assert dialog.home.isEnabled()
