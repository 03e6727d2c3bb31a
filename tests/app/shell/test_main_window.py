from __future__ import annotations

import logging
import threading
import zipfile
from functools import partial
from pathlib import Path

import pytest
from dsl_app.shared.jobs.base import Job
from dsl_app.shared.undo import Change
from dsl_app.shared.widgets import save_dialog
from dsl_app.shared.widgets.page import PageWidget
from dsl_app.shell import toasts
from dsl_app.shell.actions import ACTIONS, PAGES
from dsl_app.shell.application import ExceptionHook, make_window, open_first_page
from dsl_app.shell.main_window import MainWindow
from dsl_app.shell.paged_window import first_size
from PySide6.QtCore import QSize, Qt
from PySide6.QtGui import QCursor
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QFileDialog, QLabel, QMenu, QVBoxLayout
from pytestqt.qtbot import QtBot

from dsl_core.progress import Progress
from tests.app.support.doubles import RecordingNotifier


class Page(PageWidget):
    """A page that only says which one it is."""

    def __init__(self, key: str) -> None:
        super().__init__()
        self.opened: list[Path] = []
        self.released = False
        QVBoxLayout(self).addWidget(QLabel(key))

    def open_path(self, path: Path) -> bool:
        self.opened.append(path)
        return True

    def command_line(self) -> str:
        return "dsl-scan rigs"

    def release(self) -> None:
        self.released = True


@pytest.fixture
def window(qtbot: QtBot, tmp_path: Path) -> MainWindow:
    made = make_window({page.key: partial(Page, page.key) for page in PAGES}, tmp_path)
    open_first_page(made)
    qtbot.addWidget(made)
    made.show()
    return made


def test_what_nobody_does_is_not_offered(window: MainWindow) -> None:
    assert not window.actions_by_key["demo"].isVisible()
    assert window.actions_by_key["tour"].isVisible()


def test_shortcuts_and_mnemonics_are_unique() -> None:
    keys = [action.shortcut for action in ACTIONS if action.shortcut]
    assert len(keys) == len(set(keys))
    for menu in {action.menu for action in ACTIONS}:
        letters = [a.text[a.text.index("&") + 1].lower() for a in ACTIONS if a.menu == menu and "&" in a.text]
        assert len(letters) == len(set(letters)), menu


def test_what_is_undone_is_where_people_look_for_it(window: MainWindow) -> None:
    bar = {action.text().replace("&", ""): action.menu() for action in window.menuBar().actions()}
    assert list(bar)[:3] == ["File", "Edit", "View"]
    edit, view = bar["Edit"], bar["View"]
    assert isinstance(edit, QMenu)
    assert isinstance(view, QMenu)
    assert edit.actions() == [window.actions_by_key["undo"], window.actions_by_key["redo"]]
    assert not view.actions()[0].isSeparator()


@pytest.mark.parametrize(
    ("room", "wanted"), [((1280, 800), (1272, 760)), ((1920, 1050), (1280, 800)), ((853, 533), (845, 493))]
)
def test_the_first_window_fits_with_its_frame(room: tuple[int, int], wanted: tuple[int, int]) -> None:
    assert first_size(QSize(*room)) == QSize(*wanted)


def test_pages_are_made_when_first_opened(window: MainWindow) -> None:
    assert window.stack.count() == 1
    window.open_page("results")
    window.open_page("results")
    assert window.stack.count() == 2
    assert window.windowTitle().startswith("Results")


def test_the_keyboard_goes_on_from_the_page_that_is_opened(window: MainWindow) -> None:
    first, last = (window.rail._buttons[key] for key in (window.pages[0], window.pages[-1]))
    first.setFocus()
    window.open_page(window.pages[-1])
    assert window.focusWidget() is last
    # Somewhere else it stays.
    window.menuBar().setFocus()
    window.open_page(window.pages[0])
    assert window.focusWidget() is window.menuBar()


def test_tab_comes_to_the_page_that_is_open_however_it_was_opened(window: MainWindow) -> None:
    # The stop of the Tab key stays where the keyboard last was, and it has left from there.
    window.rail._buttons[window.pages[0]].setFocus()
    window.menuBar().setFocus()
    for page in window.pages:
        window.open_page(page)
        buttons = window.rail._buttons.items()
        assert [key for key, each in buttons if each.focusPolicy() & Qt.FocusPolicy.TabFocus] == [page]


def test_the_open_page_is_remembered(window: MainWindow, tmp_path: Path) -> None:
    window.open_page("scan")
    window.close()
    assert '"page": "scan"' in (tmp_path / "settings.json").read_text()


def test_pages_let_go_when_the_window_closes(window: MainWindow) -> None:
    page = window.open_page("rig")
    window.close()
    assert isinstance(page, Page)
    assert page.released


def test_a_file_that_nobody_knows_is_told(window: MainWindow, tmp_path: Path) -> None:
    (tmp_path / "cat.jpeg").touch()
    window.open_path(tmp_path / "cat.jpeg")
    assert "cat.jpeg is opened only with all pictures of its capture" in window.toasts.shown[-1].text


def test_a_known_file_becomes_a_recent_one(window: MainWindow, tmp_path: Path) -> None:
    (tmp_path / "zarr.json").touch()
    window.open_path(tmp_path)
    assert window.parts.settings.recent == [str(tmp_path)]


def test_a_report_bundle_replaces_a_file_after_a_person_was_asked(
    window: MainWindow, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "report.zip"
    path.write_text("old")
    monkeypatch.setattr(QFileDialog, "getSaveFileName", lambda *_: (str(path.with_suffix("")), ""))
    monkeypatch.setattr(save_dialog, "confirm", lambda *_, **__: True)
    window.actions_by_key["report_bundle"].trigger()
    assert window.toasts.shown[-1].text == f"Saved as {path}."
    assert set(zipfile.ZipFile(path).namelist()) == {"log.txt", "settings.json", "versions.json"}


def test_the_log_shows_records_of_any_thread(window: MainWindow, qtbot: QtBot) -> None:
    thread = threading.Thread(target=lambda: logging.getLogger("dsl_core.test").warning("far away"))
    thread.start()
    thread.join()
    qtbot.waitUntil(lambda: any("far away" in text for _, text in window.parts.records.lines))


def test_an_uncaught_error_of_a_thread_is_told_in_the_window(qtbot: QtBot) -> None:
    notifier = RecordingNotifier()
    hook = ExceptionHook(notifier)
    error = ValueError("odd")
    thread = threading.Thread(target=lambda: hook.handle(ValueError, error, None))
    thread.start()
    thread.join()
    qtbot.waitUntil(lambda: bool(notifier.told))
    assert "ValueError: odd" in notifier.told[0][1]


def test_an_error_that_a_job_does_not_handle_is_told_in_the_window(window: MainWindow) -> None:
    window.parts.runner.failed.emit("The disk is full.")
    assert [(toast.level, toast.text) for toast in window.toasts.shown] == [("error", "The disk is full.")]


def test_themes_reach_the_whole_window(window: MainWindow) -> None:
    window.do("theme_light")
    assert window.theme.name == "light"
    window.do("theme_dark")
    assert window.theme.name == "dark"
    assert window.palette().window().color().name() == window.theme.window


def test_an_error_stays_until_somebody_was_there_to_read_it(
    window: MainWindow, qtbot: QtBot, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(toasts, "ERROR_STAYS_MS", 40)
    monkeypatch.setattr(toasts, "LOOK_MS", 10)
    window.show()
    QCursor.setPos(0, 0)
    window.toasts.tell("error", "The camera does not answer.")
    QTest.qWait(80)
    assert window.toasts.shown
    (toast,) = window.toasts.shown
    QCursor.setPos(toast.mapToGlobal(toast.rect().center()))
    QTest.mouseMove(toast)
    QTest.qWait(80)
    assert window.toasts.shown
    QCursor.setPos(1, 1)
    QTest.mouseMove(window.stack)
    qtbot.waitUntil(lambda: not window.toasts.shown)
    assert not window.toasts.place.isVisible()
    # Who was too late reads it in the log.
    assert ("ERROR", "The camera does not answer.") in [(r.levelname, r.message) for r in caplog.records]


def test_toasts_leave_when_closed_and_never_pile_up(window: MainWindow) -> None:
    for i in range(6):
        window.toasts.tell("error", f"trouble {i}")
    assert [toast.text for toast in window.toasts.shown] == [f"trouble {i}" for i in range(2, 6)]
    window.toasts.shown[0].dismiss()
    assert len(window.toasts.shown) == 3


def test_messages_move_nothing_and_the_latest_is_in_front(window: MainWindow, qtbot: QtBot) -> None:
    window.show()
    QApplication.processEvents()
    before = window.stack.geometry()
    window.toasts.tell("info", "Written.")
    window.toasts.tell("warning", "A longer sentence " * 30)
    window.toasts.offer("Compare both?", {"Compare": lambda: None})
    QApplication.processEvents()
    written, long, offer = window.toasts.shown
    assert [toast.isVisible() for toast in (written, long, offer)] == [False, False, True]
    assert offer.behind.text() == "2 more"
    assert window.statusBar().isAncestorOf(offer)
    assert window.stack.geometry() == before
    offer.dismiss()
    QApplication.processEvents()
    assert long.isVisible()
    assert window.stack.geometry() == before
    # What does not fit is a click away.
    assert long.words.text().endswith("…")
    assert long.more.isVisible()
    long.dismiss()
    written.dismiss()
    assert not window.toasts.place.isVisible()
    assert window.stack.geometry() == before


def test_a_message_that_waits_behind_another_is_shown_for_its_whole_time(
    window: MainWindow, qtbot: QtBot, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(toasts.STAY_MS, "info", 30)
    window.show()
    window.toasts.tell("info", "Written.")
    window.toasts.offer("Compare both?", {"Compare": lambda: None})
    QTest.qWait(60)
    assert [toast.text for toast in window.toasts.shown] == ["Written.", "Compare both?"]
    window.toasts.shown[-1].dismiss()
    assert window.toasts.shown[-1].isVisible()
    qtbot.waitUntil(lambda: not window.toasts.shown)
    # An offer has its time, seen or not.
    window.toasts.offer("Take the tour?", {"Tour": lambda: None}, stay_s=0.03)
    window.toasts.tell("error", "The disk is full.")
    qtbot.waitUntil(lambda: len(window.toasts.shown) == 1)
    assert window.toasts.shown[0].text == "The disk is full."


@pytest.mark.parametrize(("is_minor", "asked"), [(True, 0), (False, 1)])
def test_only_work_that_somebody_would_miss_keeps_the_window_open(
    window: MainWindow, monkeypatch: pytest.MonkeyPatch, is_minor: bool, asked: int
) -> None:
    questions: list[str] = []

    def answer(_parent: object, _title: str, text: str, **_buttons: str) -> bool:
        questions.append(text)
        return True

    monkeypatch.setattr("dsl_app.shell.paged_window.confirm", answer)
    free = threading.Event()
    window.parts.runner.submit(Job("Long work", lambda progress: free.wait(10), is_minor=is_minor))
    threading.Timer(0.1, free.set).start()
    window.close()
    assert len(questions) == asked


def test_nobody_sees_the_window_wait_for_its_threads(window: MainWindow) -> None:
    window.show()
    begun, seen = threading.Event(), list[bool]()

    def work(progress: Progress) -> None:
        begun.set()
        try:
            while True:
                progress.report("work", 0, 0)
        finally:
            seen.append(window.isVisible())

    window.parts.runner.submit(Job("Long work", work, is_minor=True))
    assert begun.wait(10)
    window.close()
    assert seen == [False]


def test_the_window_can_be_there_before_its_page(qtbot: QtBot, tmp_path: Path) -> None:
    imports = {"rig": ("json", "there.is.no.such.module")}
    made = make_window({"rig": partial(Page, "rig")}, tmp_path)
    open_first_page(made, imports)
    qtbot.addWidget(made)
    made.show()
    assert made.stack.count() == 0
    qtbot.waitUntil(lambda: made.stack.count() == 1)
    assert made.windowTitle().startswith("Rig")
    made.close()


def test_a_change_that_cannot_be_undone_now_is_told(window: MainWindow) -> None:
    window.parts.undo.push(Change("change of plan", int, int, lambda: "A scan keeps its plan."))
    window.do("undo")
    assert window.toasts.shown[-1].text == "A scan keeps its plan."
    assert window.actions_by_key["undo"].isEnabled()
