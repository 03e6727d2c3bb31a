"""The main window: puts rail, pages, docks, menus and toasts together. Pages are made when first opened."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from PySide6.QtCore import QByteArray, QSize, Qt, QTimer, Signal
from PySide6.QtGui import QAction, QCloseEvent, QDragEnterEvent, QDropEvent, QPaintEvent
from PySide6.QtWidgets import (
    QDockWidget,
    QFileDialog,
    QHBoxLayout,
    QMainWindow,
    QMessageBox,
    QStackedWidget,
    QWidget,
)

from app.actions import ACTIONS, PAGES, Action
from app.controllers.known_files import Kind, kind_of, meant_by, refusal
from app.jobs.qt_runner import QtRunner
from app.panels.log import LogPanel, LogRecords
from app.report_bundle import write_report_bundle
from app.settings import Settings, save_settings
from app.state.recent import RecentFiles
from app.state.undo import UndoStack
from app.theme import DARK, Theme
from app.widgets import text_windows
from app.widgets.drops import dropped_paths, open_after_drop
from app.widgets.help_window import help_of, help_window
from app.widgets.job_strip import JobStrip
from app.widgets.menus import Menus
from app.widgets.page import PageWidget
from app.widgets.rail import Rail
from app.widgets.recent_menu import RecentMenu
from app.widgets.toasts import Toasts
from app.widgets.tour import Tour
from app.widgets.tour_steps import STEPS, Step
from dsl_core.errors import DslError

_log = logging.getLogger(__name__)
SMALLEST = QSize(1024, 700)
#: Rises when docks change, so that a layout of an older version is not restored.
LAYOUT_VERSION = 1


@dataclass
class Parts:
    """What the window is made of and hands to its pages."""

    settings: Settings
    settings_path: Path
    records: LogRecords
    runner: QtRunner
    undo: UndoStack
    set_theme: Callable[[str], Theme]
    recent: RecentFiles


PageMaker = Callable[["MainWindow"], PageWidget]
Command = Callable[["MainWindow"], object]


class MainWindow(QMainWindow):
    """The application's window.

    ``pages`` makes the widget of each page of the rail; ``commands`` do the actions of the table that neither
    a page nor the window itself can do. ``painted`` tells once that the window is on
    screen, ``closed`` that it ends well.
    """

    painted = Signal()
    closed = Signal()

    def __init__(
        self, parts: Parts, pages: dict[str, PageMaker], commands: dict[str, Command] | None = None
    ) -> None:
        super().__init__()
        self._commands = commands or {}
        self._is_painted = False
        self.parts = parts
        self.theme: Theme = DARK
        self.setWindowTitle("dsl-scan")
        self.setMinimumSize(SMALLEST)
        self.resize(1280, 800)
        self.setAcceptDrops(True)
        self._makers = pages
        self._made: dict[str, PageWidget] = {}
        self.toasts = Toasts(self)
        self._tour: Tour | None = None
        self.menuBar().setObjectName("menu-bar")
        self.rail = Rail([page for page in PAGES if page.key in pages])
        self.rail.chosen.connect(self.open_page)
        self.stack = QStackedWidget()
        self._lay_out()
        self.actions_by_key: dict[str, QAction] = {}
        self._make_menus()
        self._log_dock = self._make_log_dock()
        self.strip = JobStrip(parts.runner)
        self.statusBar().addPermanentWidget(self.strip)
        parts.undo.changed.connect(lambda _: self._show_undo())
        self._show_undo()
        self.apply_theme(parts.settings.theme)
        self._restore()

    def _lay_out(self) -> None:
        centre = QWidget()
        row = QHBoxLayout(centre)
        row.setContentsMargins(0, 0, 0, 0)
        row.setSpacing(0)
        row.addWidget(self.rail)
        row.addWidget(self.stack, 1)
        self.setCentralWidget(centre)

    def _make_menus(self) -> None:
        menus = Menus(self, ACTIONS, self.do)
        self.actions_by_key = menus.actions
        for action in ACTIONS:
            menus.actions[action.key].setVisible(self._can(action))
        self.recent_menu = RecentMenu(self.parts.recent, self.open_path, self)
        menus.put_after("open", self.recent_menu)

    def _can(self, action: Action) -> bool:
        """Whether anybody here does an action; what nobody does is not shown."""
        if action.key.startswith("page_"):
            return action.key.removeprefix("page_") in self._makers
        done_here = action.key in self._commands or hasattr(self, f"do_{action.key}")
        return bool(action.page) or done_here or action.key.startswith("theme_")

    def _make_log_dock(self) -> QDockWidget:
        dock = QDockWidget("Log", self)
        dock.setObjectName("log-dock")
        dock.setWidget(LogPanel(self.parts.records))
        self.addDockWidget(Qt.DockWidgetArea.BottomDockWidgetArea, dock)
        dock.hide()
        return dock

    # Pages -----------------------------------------------------------------------------------------

    @property
    def page(self) -> str:
        """Key of the page that is open."""
        return self.parts.settings.page

    def open_page(self, key: str) -> PageWidget:
        """Show a page, making it when it is opened for the first time."""
        page = self.page_of(key)
        self.stack.setCurrentWidget(page)
        self.rail.mark(key)
        self.parts.settings.page = key
        for action in ACTIONS:
            if action.page:
                self.actions_by_key[action.key].setEnabled(action.page == key)
        title = next(page.title for page in PAGES if page.key == key)
        self.setWindowTitle(f"{title} – dsl-scan")
        return page

    def page_of(self, key: str) -> PageWidget:
        """The widget of a page, made when it is asked for first; it need not be open."""
        if key not in self._made:
            self._made[key] = self._makers[key](self)
            self.stack.addWidget(self._made[key])
        return self._made[key]

    # Actions ---------------------------------------------------------------------------------------

    def do(self, key: str) -> None:
        """Do the action of a key: of the open page where it offers it, else of the window."""
        if key.startswith("page_"):
            self.open_page(key.removeprefix("page_"))
        elif key.startswith("theme_"):
            self.apply_theme(key.removeprefix("theme_"))
        else:
            method = self.page_of(self.page).page_actions().get(key)
            if method is not None:
                method()
            elif key in self._commands:
                self._commands[key](self)
            else:
                getattr(self, f"do_{key}")()

    def do_open(self) -> None:
        """Choose a file to open."""
        name, _ = QFileDialog.getOpenFileName(self, "Open", self.parts.settings.output_folder)
        if name:
            self.open_path(Path(name))

    def do_open_last(self) -> None:
        """Open the file again that was opened last."""
        if self.parts.recent.paths.value:
            self.open_path(self.parts.recent.paths.value[0])
        else:
            self.toasts.tell("info", "Nothing was opened yet. Choose a file by File, Open.")

    def open_path(self, path: Path) -> None:
        """Open a file or folder on the page that knows it, the open page first; says why when none does."""
        path = meant_by(path)
        kind = kind_of(path)
        if kind not in (Kind.MISSING, Kind.UNKNOWN):
            for key in (self.page, *(key for key in self._makers if key != self.page)):
                if self.page_of(key).open_path(path):
                    self.parts.recent.add(path)
                    self.open_page(key)
                    return
        if kind is Kind.MISSING:
            self.parts.recent.forget(path)
        self.toasts.tell("warning", refusal(path))

    def paintEvent(self, event: QPaintEvent) -> None:
        """Tell of the first paint, once what was painted has reached the screen."""
        super().paintEvent(event)
        if not self._is_painted:
            self._is_painted = True
            QTimer.singleShot(0, self, self.painted.emit)

    def dragEnterEvent(self, event: QDragEnterEvent) -> None:
        """Files may be dropped anywhere."""
        if dropped_paths(event.mimeData()):
            event.acceptProposedAction()

    def dropEvent(self, event: QDropEvent) -> None:
        """Open what was dropped."""
        event.acceptProposedAction()
        open_after_drop(dropped_paths(event.mimeData()), self.open_path, self)

    def do_export(self) -> None:
        """Exporting needs a result."""
        self.toasts.tell("info", "There is nothing to export on this page. Open a result first.")

    def do_show_command(self) -> None:
        """Show the command line of the open page."""
        command = self.page_of(self.page).command_line()
        if command:
            text_windows.command_window(command, self).open()
        else:
            self.toasts.tell("info", "Open something on this page first; then its command is shown here.")

    def do_help_page(self) -> None:
        """Explain what has the focus, else the open page."""
        page = next(page for page in PAGES if page.key == self.page)
        help_window(help_of(self.focusWidget()) or page.help, self).show()

    def do_tour(self) -> None:
        """Show what is where."""
        if self._tour is not None:
            return
        self._tour = Tour([step for step in STEPS if step.page in self._makers], self.theme, self)
        self._tour.wanted.connect(self._show_step)
        self._tour.ended.connect(self._end_tour)
        self._tour.start()
        self.parts.settings.tour_seen = True

    def _show_step(self, step: Step) -> None:
        page = self.open_page(step.page)
        # Parts of a result are only there while one is open.
        target = self.findChild(QWidget, step.target)
        assert self._tour is not None
        self._tour.point_at(target if target is not None and target.isVisible() else page)

    def _end_tour(self) -> None:
        self._tour = None

    def do_shortcuts(self) -> None:
        """Show all keys."""
        text_windows.shortcuts_window(ACTIONS, self).open()

    def do_about(self) -> None:
        """Say what this is."""
        text_windows.about_window(self).open()

    def do_report_bundle(self) -> None:
        """Save what a bug report needs."""
        name, _ = QFileDialog.getSaveFileName(
            self, "Save a report bundle", "dsl-scan-report.zip", "Zip (*.zip)"
        )
        if not name:
            return
        try:
            lines = [text for _, text in self.parts.records.lines]
            write_report_bundle(Path(name), lines, self.parts.settings)
        except DslError as error:
            self.toasts.tell("error", str(error))
        else:
            self.toasts.tell("info", f"Saved as {name}.")

    def do_quit(self) -> None:
        """Leave."""
        self.close()

    def do_undo(self) -> None:
        """Take the last change back."""
        self.parts.undo.undo()

    def do_redo(self) -> None:
        """Do again what was taken back."""
        self.parts.undo.redo()

    def do_show_log(self) -> None:
        """Show or hide the log."""
        self._log_dock.setVisible(not self._log_dock.isVisible())

    def do_cancel_jobs(self) -> None:
        """Stop everything that runs."""
        if not self.parts.runner.active:
            self.toasts.tell("info", "Nothing is running.")
        self.parts.runner.cancel_all()

    def _show_undo(self) -> None:
        for key, word, text in (
            ("undo", "&Undo", self.parts.undo.undo_text),
            ("redo", "&Redo", self.parts.undo.redo_text),
        ):
            self.actions_by_key[key].setEnabled(bool(text))
            self.actions_by_key[key].setText(f"{word} {text}".strip())

    # Theme, memory, end ----------------------------------------------------------------------------

    def apply_theme(self, name: str) -> None:
        """Show a theme by name: system, light or dark."""
        self.theme = self.parts.set_theme(name)
        self.parts.settings.theme = name  # type: ignore[assignment]
        self.rail.paint_icons(self.theme)
        for key in ("system", "light", "dark"):
            self.actions_by_key[f"theme_{key}"].setChecked(key == name)
        for page in self._made.values():
            page.apply_theme(self.theme)

    def _restore(self) -> None:
        settings = self.parts.settings
        for text, restore in (
            (settings.window_geometry, self.restoreGeometry),
            (settings.window_state, lambda state: self.restoreState(state, LAYOUT_VERSION)),
        ):
            # Qt leaves the layout at hand when it cannot make sense of this one.
            restore(QByteArray.fromBase64(text.encode()))

    def remember(self) -> None:
        """Write the settings, the layout among them."""
        settings = self.parts.settings
        settings.window_geometry = bytes(self.saveGeometry().toBase64().data()).decode()
        settings.window_state = bytes(self.saveState(LAYOUT_VERSION).toBase64().data()).decode()
        trouble = save_settings(settings, self.parts.settings_path)
        if trouble:
            _log.warning("%s", trouble)

    def closeEvent(self, event: QCloseEvent) -> None:
        """Ask before work is stopped; end all threads and remember the layout."""
        if not self._may_stop():
            event.ignore()
            return
        for page in self._made.values():
            page.release()
        self.parts.runner.shut_down()
        self.remember()
        self.closed.emit()
        # Python's logging outlives the window and must not call into it.
        logging.getLogger().removeHandler(self.parts.records)
        event.accept()

    def _may_stop(self) -> bool:
        titles = ", ".join(job.title for job in self.parts.runner.active if not job.is_minor)
        if not titles:
            return True
        answer = QMessageBox.question(
            self,
            "Work is running",
            f"{titles} is still running. Stop it and leave? What is captured is kept and can be resumed.",
        )
        return answer == QMessageBox.StandardButton.Yes
