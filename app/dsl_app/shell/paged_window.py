"""A window with a rail of pages and toasts: opens pages and files, applies themes, closes safely."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from PySide6.QtCore import QByteArray, QObject, QSize, QTimer, Signal
from PySide6.QtGui import QCloseEvent, QDragEnterEvent, QDropEvent, QKeyEvent, QPaintEvent
from PySide6.QtWidgets import QMainWindow, QStackedWidget

from dsl_app.shared.jobs.qt_runner import QtRunner
from dsl_app.shared.known_files import Kind, has_pictures, kind_of, meant_by, refusal
from dsl_app.shared.settings import RecentFiles, Settings, SettingsFile
from dsl_app.shared.theme import DARK, Theme, style_sheet
from dsl_app.shared.undo import UndoStack
from dsl_app.shared.widgets.dialogs import confirm
from dsl_app.shared.widgets.layouts import boxed, row_of
from dsl_app.shared.widgets.page import PageWidget, dropped_paths
from dsl_app.shell.actions import PAGES, Page
from dsl_app.shell.enter_key import button_of_enter, is_enter
from dsl_app.shell.job_strip import JobStrip
from dsl_app.shell.log import LogRecords
from dsl_app.shell.rail import Rail
from dsl_app.shell.status_line import StatusLine
from dsl_app.shell.toasts import Toasts

_log = logging.getLogger(__name__)
SMALLEST, USUAL = QSize(1024, 640), QSize(1280, 800)
#: What pages need on any screen: that of a laptop at one and a half times the size has 853 x 533 px.
LEAST = QSize(840, 480)
#: What a desktop draws around a window, px: its frame is known only once the window is on screen.
FRAME = QSize(8, 40)
#: Increased when docks change, so that a layout of an older version is not restored.
LAYOUT_VERSION = 1


@dataclass
class Parts:
    """What the window is made of and passes to its pages."""

    settings: Settings
    settings_file: SettingsFile
    records: LogRecords
    runner: QtRunner
    undo: UndoStack
    set_theme: Callable[[str], Theme]
    recent: RecentFiles

    @property
    def settings_path(self) -> Path:
        """Where the settings are kept."""
        return self.settings_file.path


class PagedWindow(QMainWindow):
    """Pages are made by ``makers`` when they are first opened; ``handlers`` open files of other kinds.

    ``opened`` tells the key of the page that is open now, ``painted`` once that the window is on screen,
    ``closed`` that it has closed.
    """

    opened = Signal(str)
    painted = Signal()
    closed = Signal()

    def __init__(
        self,
        parts: Parts,
        makers: Mapping[str, Callable[[], PageWidget]],
        handlers: Mapping[Kind, Callable[[Path], object]],
    ) -> None:
        super().__init__()
        self._handlers = handlers
        self.parts = parts
        self.theme: Theme = DARK
        self._is_painted = False
        self._makers, self._made = makers, dict[str, PageWidget]()
        self.setWindowTitle("dsl-scan")
        room = self.screen().availableSize()
        self.setMinimumSize(least_size(room))
        self.resize(first_size(room))
        self.setAcceptDrops(True)
        line = StatusLine()
        self.setStatusBar(line)
        self.toasts = Toasts(line)
        self.rail = Rail([page for page in PAGES if page.key in makers])
        self.rail.chosen.connect(self.open_page)
        self.stack = QStackedWidget()
        self.strip = JobStrip(parts.runner)
        self.statusBar().addPermanentWidget(self.strip)
        self._dropped = OpenQueue(self.open_path, self._is_reading, self)
        parts.runner.changed.connect(self._dropped.open_next)
        parts.runner.failed.connect(lambda text: self.toasts.tell("error", text))
        self._lay_out()

    def _lay_out(self) -> None:
        self.setCentralWidget(boxed(row_of(self.rail, (self.stack, 1), margins=0, spacing=0)))

    # Pages -----------------------------------------------------------------------------------------

    @property
    def page(self) -> str:
        """Key of the page that is open."""
        return self.parts.settings.page

    @property
    def about_page(self) -> Page:
        """What the table says of the page that is open."""
        return next(page for page in PAGES if page.key == self.page)

    @property
    def pages(self) -> tuple[str, ...]:
        """Keys of all pages, made or not."""
        return tuple(self._makers)

    def open_page(self, key: str) -> PageWidget:
        """Show a page, making it when it is opened for the first time."""
        page = self.page_of(key)
        self.stack.setCurrentWidget(page)
        self.rail.mark(key)
        self.parts.settings.page = key
        self.setWindowTitle(f"{self.about_page.title} – dsl-scan")
        self.opened.emit(key)
        return page

    def page_of(self, key: str) -> PageWidget:
        """The widget of a page, made when it is asked for first; it need not be open."""
        if key not in self._made:
            self._made[key] = self._makers[key]()
            self._made[key].apply_theme(self.theme)
            self.stack.addWidget(self._made[key])
        return self._made[key]

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Enter, where no part has a use of its own for it, presses a button as a click would."""
        button = button_of_enter(self.page_of(self.page), self.focusWidget()) if is_enter(event) else None
        if button is None:
            super().keyPressEvent(event)
        else:
            button.click()

    # Files -----------------------------------------------------------------------------------------

    def open_path(self, path: Path) -> None:
        """Open a file or folder on the page that can, the open page first; a message tells why none does."""
        path = meant_by(path)
        kind = kind_of(path)
        if kind is Kind.UNKNOWN and has_pictures(path):
            # Each folder in it is a capture, of which the dialog offers the choice.
            kind = Kind.PICTURES
        if kind in self._handlers:
            self._handlers[kind](path)
            return
        if kind not in (Kind.MISSING, Kind.UNKNOWN):
            for key in (self.page, *(key for key in self._makers if key != self.page)):
                if self.page_of(key).open_path(path):
                    self.parts.recent.add(path)
                    self.save_early()
                    self.open_page(key)
                    return
        if kind is Kind.MISSING:
            self.parts.recent.forget(path)
        self.toasts.tell("warning", refusal(path))

    def dragEnterEvent(self, event: QDragEnterEvent) -> None:
        """Files may be dropped anywhere."""
        if dropped_paths(event.mimeData()):
            event.acceptProposedAction()

    def dropEvent(self, event: QDropEvent) -> None:
        """Open what was dropped, one after the other."""
        event.acceptProposedAction()
        self._dropped.add(dropped_paths(event.mimeData()))

    def _is_reading(self) -> bool:
        return any(page.is_reading for page in self._made.values())

    # Theme, settings, closing ----------------------------------------------------------------------

    def paintEvent(self, event: QPaintEvent) -> None:
        """Emit ``painted`` after the first paint has reached the screen."""
        super().paintEvent(event)
        if not self._is_painted:
            self._is_painted = True
            QTimer.singleShot(0, self, self.painted.emit)

    def apply_theme(self, name: str) -> None:
        """Show a theme by name: system, light or dark."""
        self.theme = self.parts.set_theme(name)
        # Not of the application: each part would be styled again each time it is put into a larger one.
        sheet = style_sheet(self.theme)
        if self.styleSheet() != sheet:  # the same one again would cost a look at every widget
            self.setStyleSheet(sheet)
        self.parts.settings.theme = name  # type: ignore[assignment]
        self.rail.paint_icons(self.theme)
        for page in self._made.values():
            page.apply_theme(self.theme)

    def save_settings(self) -> None:
        """Write the settings, including the layout."""
        save_layout(self, self.parts.settings)
        trouble = self.parts.settings_file.save()
        if trouble:
            _log.warning("%s", trouble)

    def save_early(self) -> None:
        """Write what must outlive a crash."""
        trouble = self.parts.settings_file.save_early()
        if trouble:
            _log.warning("%s", trouble)

    def closeEvent(self, event: QCloseEvent) -> None:
        """Ask before jobs are stopped or work is lost; end all threads and save the layout."""
        if not self._may_stop() or not self._may_lose():
            event.ignore()
            return
        for page in self._made.values():
            page.release()
        self.save_settings()
        # What a job does between two safe points can take seconds, in which the window would stand still.
        self.hide()
        self.parts.runner.shut_down()
        self.closed.emit()
        # Python's logging outlives the window and must not call into it.
        logging.getLogger().removeHandler(self.parts.records)
        event.accept()

    def _may_stop(self) -> bool:
        titles = [job.title for job in self.parts.runner.active if not job.is_minor]
        if not titles:
            return True
        are, them = ("is", "it") if len(titles) == 1 else ("are", "them")
        return confirm(
            self,
            "Jobs are running",
            f"{' and '.join(titles)} {are} still running. Stop {them} and quit? What is saved is kept, and"
            " scans and reconstructions can be resumed.",
            go="Stop and quit",
            stay="Keep working",
        )

    def _may_lose(self) -> bool:
        lost = " ".join(filter(None, (page.unsaved() for page in self._made.values())))
        if not lost:
            return True
        return confirm(
            self, "Not saved", f"{lost} Quit without them?", go="Quit all the same", stay="Keep working"
        )


class OpenQueue(QObject):
    """Opens files one after the other, each after the previous one has been read."""

    def __init__(
        self, open_path: Callable[[Path], object], is_reading: Callable[[], bool], parent: QObject
    ) -> None:
        super().__init__(parent)
        self._open_path, self._is_reading = open_path, is_reading
        self._waiting: list[Path] = []
        self._is_opening = False

    def add(self, paths: list[Path]) -> None:
        """Open files once the drop is over, so that its sender does not wait."""
        self._waiting.extend(paths)
        QTimer.singleShot(0, self, self.open_next)

    def open_next(self) -> None:
        """Open waiting files while nothing is being read; called when a job starts, progresses or ends."""
        if self._is_opening:
            return  # opening a file begins work itself
        self._is_opening = True
        try:
            while self._waiting and not self._is_reading():
                self._open_path(self._waiting.pop(0))
        finally:
            self._is_opening = False


def first_size(room: QSize) -> QSize:
    """The size of a window that was never opened: with its frame it fits into the room of the screen."""
    return USUAL.boundedTo(room - FRAME).expandedTo(least_size(room))


def least_size(room: QSize) -> QSize:
    """The smallest size of a window; a screen that is magnified may have room for less than is usual."""
    return SMALLEST.boundedTo((room - FRAME).expandedTo(LEAST))


def restore_layout(window: QMainWindow, settings: Settings) -> None:
    """Restore window and docks; Qt ignores a layout that it cannot read."""
    window.restoreGeometry(QByteArray.fromBase64(settings.window_geometry.encode()))
    window.restoreState(QByteArray.fromBase64(settings.window_state.encode()), LAYOUT_VERSION)


def save_layout(window: QMainWindow, settings: Settings) -> None:
    """Store the layout of window and docks in the settings."""
    settings.window_geometry = _text(window.saveGeometry())
    settings.window_state = _text(window.saveState(LAYOUT_VERSION))


def _text(data: QByteArray) -> str:
    return bytes(data.toBase64().data()).decode()
