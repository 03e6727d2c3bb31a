"""Reconstruct again by mouse and keys: from the Results page to the comparison of both."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from dsl_app.compare.page import ComparePage
from dsl_app.composition.window import Composition, StartOptions
from dsl_app.results.page import ResultsPage
from dsl_app.results.reconstruct_again.dialog import ReconstructionDialog
from dsl_app.results.reconstruct_again.state import Reconstructed
from dsl_app.shared.widgets.open_dialog import OpenDialog
from dsl_app.shell.main_window import MainWindow
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QFileDialog, QPlainTextEdit, QPushButton
from pytestqt.qtbot import QtBot

from tests.app.composition.test_names import complaints
from tests.app.support.compare_bench import make_result
from tests.app.support.real_window import show_window

PATIENCE_MS = 60_000


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with ``small.dsl`` and ``small.zarr``; to be read only."""
    return make_result(tmp_path_factory.mktemp("finished"), "small").parent


@pytest.fixture
def composed(qtbot: QtBot, finished: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Composition:
    """The application, with a result of a scan beside it open in its window."""
    monkeypatch.setenv("DSL_SCAN_HOME", str(tmp_path / "home"))
    # What is still read when the window closes is not asked about.
    monkeypatch.setattr("dsl_app.shell.paged_window.confirm", lambda *_, **__: True)
    composition = Composition(StartOptions())
    made = composition.open_window(tmp_path / "home")
    show_window(qtbot, made)
    shutil.copytree(finished, tmp_path, dirs_exist_ok=True)
    made.open_path(tmp_path / "small.zarr")
    qtbot.waitUntil(lambda: not made.parts.runner.active, timeout=PATIENCE_MS)
    return composition


@pytest.fixture
def window(composed: Composition) -> MainWindow:
    return composed.window


def opened(qtbot: QtBot, window: MainWindow) -> ReconstructionDialog:
    found: list[ReconstructionDialog] = []

    def look() -> bool:
        found[:] = [each for each in window.findChildren(ReconstructionDialog) if each.isVisible()]
        return bool(found)

    qtbot.waitUntil(look, timeout=PATIENCE_MS)
    return found[0]


def results(window: MainWindow) -> ResultsPage:
    page = window.page_of("results")
    assert isinstance(page, ResultsPage)
    return page


@pytest.mark.slow
def test_a_second_result_is_made_opened_and_compared(
    qtbot: QtBot, window: MainWindow, tmp_path: Path
) -> None:
    QTest.mouseClick(results(window).reconstruct_again, Qt.MouseButton.LeftButton)
    dialog = opened(qtbot, window)
    assert complaints(dialog) == []
    # The name is typed first, by who knows what all the rest means.
    assert dialog.focusWidget() is dialog.name
    QTest.keyClicks(dialog.name, "coarse")
    dialog.step.setFocus()
    dialog.step.selectAll()
    QTest.keyClicks(dialog.step, "7")
    QTest.keyClick(dialog.step, Qt.Key.Key_Tab)
    assert "does not end on a band" in dialog.text.text()
    assert not dialog.go.isEnabled()
    dialog.step.setValue(46)
    assert dialog.text.text().startswith("6 bands")
    QTest.mouseClick(dialog.go, Qt.MouseButton.LeftButton)
    qtbot.waitUntil(lambda: bool(window.toasts.shown), timeout=PATIENCE_MS)
    said = window.toasts.shown[-1]
    assert said.text.startswith("coarse.zarr is open on the Results page")
    qtbot.waitUntil(lambda: not window.parts.runner.active, timeout=PATIENCE_MS)
    assert results(window).subject() == tmp_path / "coarse.zarr"
    assert window.parts.settings.recent[0] == str(tmp_path / "coarse.zarr")
    page = window.open_page("compare")
    assert isinstance(page, ComparePage)
    page.tabs.setCurrentIndex(1)
    (compare,) = [each for each in said.findChildren(QPushButton) if each.text() == "Compare both"]
    QTest.mouseClick(compare, Qt.MouseButton.LeftButton)
    assert page.tabs.currentWidget() is page.pair
    qtbot.waitUntil(lambda: page.pair._state.pair.value is not None, timeout=PATIENCE_MS)
    assert (page.pair.name_a.text(), page.pair.name_b.text()) == ("A: small", "B: coarse")


def test_the_dialog_shows_what_it_asks_for(
    qtbot: QtBot, window: MainWindow, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    window.do("reconstruct_again")
    dialog = opened(qtbot, window)
    dialog.spectra.setChecked(False)
    assert not dialog.solver.isEnabled()
    assert not dialog.override.isEnabled()
    file = str(tmp_path / "other.json")
    monkeypatch.setattr(QFileDialog, "getOpenFileName", lambda *_: (file, ""))
    dialog.file.click()
    assert dialog.calibration.currentText() == "other.json"
    assert dialog.override.isEnabled()
    dialog.command.click()
    (text,) = dialog.findChildren(QPlainTextEdit)
    assert text.toPlainText().endswith(f"--depth-only --calibration {file}")
    QApplication.activeModalWidget().close()  # type: ignore[union-attr]
    dialog.reject()
    assert not (tmp_path / "small-2.zarr").exists()


@pytest.mark.slow
def test_who_works_elsewhere_is_not_torn_away(qtbot: QtBot, window: MainWindow, tmp_path: Path) -> None:
    window.do("reconstruct_again")
    dialog = opened(qtbot, window)
    dialog.spectra.setChecked(False)
    dialog.go.click()
    window.open_page("rig")
    qtbot.waitUntil(lambda: (tmp_path / "small-2.zarr").exists(), timeout=PATIENCE_MS)
    qtbot.waitUntil(lambda: bool(window.toasts.shown), timeout=PATIENCE_MS)
    assert window.page == "rig"
    (show,) = [b for b in window.toasts.shown[-1].findChildren(QPushButton) if b.text() == "Show result"]
    show.click()
    assert window.page == "results"


def test_a_result_is_not_said_to_be_open_where_the_page_was_busy(
    qtbot: QtBot, composed: Composition, tmp_path: Path
) -> None:
    window = composed.window
    page = results(window)
    before = page.subject()
    page._state.busy.set("Reconstruct other.dsl")
    made = Path(shutil.copytree(tmp_path / "small.zarr", tmp_path / "second.zarr"))
    composed.reconstruct_again.control.state.done.emit(Reconstructed(made, None))
    qtbot.waitUntil(lambda: bool(window.toasts.shown), timeout=PATIENCE_MS)
    (said,) = window.toasts.shown
    assert said.text == "second.zarr is saved."
    assert page.subject() == before
    page._state.busy.set("")
    (show,) = [each for each in said.findChildren(QPushButton) if each.text() == "Show result"]
    show.click()
    qtbot.waitUntil(lambda: page.subject() == made, timeout=PATIENCE_MS)


def test_elsewhere_it_asks_for_the_scan(
    qtbot: QtBot, window: MainWindow, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    window.open_page("rig")
    monkeypatch.setattr(OpenDialog, "ask", lambda *_, **__: tmp_path)
    window.do("reconstruct_again")
    qtbot.waitUntil(lambda: bool(window.toasts.shown), timeout=PATIENCE_MS)
    assert "is not a scan" in window.toasts.shown[-1].text
