"""Files dropped anywhere on the real window, and the menu of recent ones."""

from __future__ import annotations

from pathlib import Path

import pytest
from dsl_app.composition.window import Composition, StartOptions
from dsl_app.results.page import ResultsPage
from dsl_app.scan.page import ScanPage
from dsl_app.shared.settings import Settings, save_settings
from dsl_app.shell.main_window import MainWindow
from PySide6.QtCore import QMimeData, QPoint, QPointF, Qt, QUrl
from PySide6.QtGui import QDragEnterEvent, QDropEvent
from PySide6.QtWidgets import QApplication
from pytestqt.qtbot import QtBot

from dsl_core.io.plan_file import save_plan
from dsl_core.io.result.annotations_file import Annotations, PinRecord, save_annotations
from dsl_core.model.plan import CapturePlan, LineComb
from tests.app.support.locked import lock
from tests.app.support.real_window import show_window
from tests.app.support.small_result import RED, write_reference, write_small_result


@pytest.fixture
def window(qtbot: QtBot, tmp_path: Path) -> MainWindow:
    composition = Composition(StartOptions())
    made = composition.open_window(tmp_path / "home")
    show_window(qtbot, made)
    return made


def drop(window: MainWindow, *paths: Path) -> bool:
    """Drag files over the middle of the window and let go; whether the window wanted them."""
    data = QMimeData()
    data.setUrls([QUrl.fromLocalFile(str(path)) for path in paths])
    left, none = Qt.MouseButton.LeftButton, Qt.KeyboardModifier.NoModifier
    enter = QDragEnterEvent(QPoint(500, 300), Qt.DropAction.CopyAction, data, left, none)
    QApplication.sendEvent(window, enter)
    if enter.isAccepted():
        QApplication.sendEvent(
            window, QDropEvent(QPointF(500, 300), Qt.DropAction.CopyAction, data, left, none)
        )
    return enter.isAccepted()


def result_of(window: MainWindow) -> Path | None:
    page = window.page_of("results")
    assert isinstance(page, ResultsPage)
    result = page._state.result.value
    return None if result is None or page.is_reading else result.path


def test_a_result_opens_where_results_are(qtbot: QtBot, window: MainWindow, tmp_path: Path) -> None:
    path = write_small_result(tmp_path)
    assert drop(window, path)
    qtbot.waitUntil(lambda: window.page == "results")
    assert window.parts.settings.recent == [str(path)]
    qtbot.waitUntil(lambda: not window.parts.runner.active, timeout=10_000)
    window.close()


def test_a_file_inside_a_result_means_the_result(qtbot: QtBot, window: MainWindow, tmp_path: Path) -> None:
    path = write_small_result(tmp_path)
    drop(window, path / "zarr.json")
    qtbot.waitUntil(lambda: window.parts.settings.recent == [str(path)])
    qtbot.waitUntil(lambda: not window.parts.runner.active, timeout=10_000)
    window.close()


def test_a_wrong_file_is_told_with_what_is_known(qtbot: QtBot, window: MainWindow, tmp_path: Path) -> None:
    (tmp_path / "cat.jpeg").write_bytes(b"\xff\xd8")
    drop(window, tmp_path / "cat.jpeg", write_reference(tmp_path / "tile.csv", RED))
    qtbot.waitUntil(lambda: len(window.toasts.shown) == 2)
    assert "cat.jpeg is opened only with all pictures of its capture" in window.toasts.shown[0].text
    assert "Open a result first" in window.toasts.shown[1].text
    assert window.parts.settings.recent == []
    window.close()


def test_results_that_are_dropped_together_are_opened_in_turn(
    qtbot: QtBot, window: MainWindow, tmp_path: Path
) -> None:
    (tmp_path / "b").mkdir()
    first, second = write_small_result(tmp_path), write_small_result(tmp_path / "b")
    drop(window, first, second)
    qtbot.waitUntil(lambda: result_of(window) == second, timeout=10_000)
    assert window.parts.settings.recent == [str(second), str(first)]
    assert window.toasts.shown == ()
    window.close()


def test_a_reference_waits_for_the_result_that_is_dropped_with_it(
    qtbot: QtBot, window: MainWindow, tmp_path: Path
) -> None:
    path = write_small_result(tmp_path)
    save_annotations(Annotations(pins=(PinRecord(name="kept pin", pixel=(7, 8)),)), path)
    drop(window, path, write_reference(tmp_path / "tile.csv", RED))
    page = window.open_page("results")
    assert isinstance(page, ResultsPage)
    marks = page._state.marks
    qtbot.waitUntil(lambda: [mark.name for mark in marks.value] == ["kept pin", "tile"], timeout=10_000)
    assert window.toasts.shown == ()
    window.close()


def test_text_is_not_taken_for_a_file(window: MainWindow) -> None:
    assert not drop(window)
    window.close()


def test_the_menu_lists_what_was_opened_and_marks_what_is_gone(window: MainWindow, tmp_path: Path) -> None:
    window.parts.recent.add(tmp_path / "gone.zarr")
    window.recent_menu.fill()
    (entry,) = window.recent_menu.actions()
    assert "gone.zarr" in entry.text()
    assert "(missing)" in entry.text()
    entry.trigger()
    assert "no longer exists" in window.toasts.shown[-1].text
    window.recent_menu.fill()
    assert not window.recent_menu.actions()[0].isEnabled()
    window.close()


def test_a_plan_is_planned(qtbot: QtBot, window: MainWindow, tmp_path: Path) -> None:
    path = save_plan(CapturePlan(name="mine", spectral=LineComb(period_px=64)), tmp_path / "mine.json")
    assert drop(window, path)
    qtbot.waitUntil(lambda: window.page == "scan", timeout=30_000)
    page = window.page_of("scan")
    assert isinstance(page, ScanPage)
    qtbot.waitUntil(lambda: page.plan.period.value() == 64, timeout=30_000)
    qtbot.waitUntil(lambda: not window.parts.runner.active, timeout=30_000)
    window.close()


def test_folders_that_may_not_be_entered_keep_nothing_from_opening(
    qtbot: QtBot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    locked = tmp_path / "locked"
    (locked / "campaign").mkdir(parents=True)
    settings = Settings(
        recent=[str(locked / "cup.zarr")], output_folder=str(locked), campaign=str(locked / "campaign")
    )
    (tmp_path / "home").mkdir()
    assert save_settings(settings, tmp_path / "home" / "settings.json") == ""
    lock(monkeypatch, locked)
    window = Composition(StartOptions()).open_window(tmp_path / "home")
    show_window(qtbot, window)
    (entry,) = window.recent_menu.actions()[:1]
    assert entry.text().endswith("(no access)")
    for page in ("scan", "calibrate", "start"):
        window.open_page(page)
        assert window.page == page
    drop(window, locked / "cup.zarr")
    qtbot.waitUntil(lambda: bool(window.toasts.shown), timeout=10_000)
    assert "cannot be read (Permission denied)" in window.toasts.shown[-1].text
    qtbot.waitUntil(lambda: not window.parts.runner.active, timeout=10_000)
    window.close()
