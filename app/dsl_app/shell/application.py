"""The application: Qt, theme, log, the one exception hook, and the window."""

from __future__ import annotations

import builtins
import logging
import sys
import threading
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import TracebackType

from PySide6.QtCore import QObject, Qt, Signal
from PySide6.QtGui import QColor, QIcon, QPalette
from PySide6.QtWidgets import QApplication

from dsl_app.shared.jobs.base import Job
from dsl_app.shared.jobs.memory import CHECK_MS, GarbageCollector
from dsl_app.shared.jobs.qt_runner import QtRunner
from dsl_app.shared.known_files import Kind
from dsl_app.shared.notify import Notifier
from dsl_app.shared.settings import RecentFiles, SettingsFile, load_settings, settings_folder
from dsl_app.shared.theme import DARK, LIGHT, Theme
from dsl_app.shared.undo import UndoStack
from dsl_app.shared.widgets.icons import icon
from dsl_app.shared.widgets.page import PageWidget
from dsl_app.shared.widgets.ticker import Ticker
from dsl_app.shell.log import LogRecords
from dsl_app.shell.main_window import MainWindow
from dsl_app.shell.paged_window import Parts
from dsl_app.shell.warm_up import import_early
from dsl_core.solve.heap import keep_freed_memory, limit_heaps

_log = logging.getLogger(__name__)
_SCHEMES = {
    "system": Qt.ColorScheme.Unknown,
    "light": Qt.ColorScheme.Light,
    "dark": Qt.ColorScheme.Dark,
}


#: How long a thread keeps Python's lock while the window waits for it, s: painting needs it often.
SWITCH_S = 0.001


def make_application(arguments: Sequence[str]) -> QApplication:
    """The one Qt application, in a style that looks alike on all systems."""
    sys.setswitchinterval(SWITCH_S)
    limit_heaps()
    keep_freed_memory()
    _remove_import_hook()
    application = QApplication.instance()
    if not isinstance(application, QApplication):
        application = QApplication(list(arguments))
    application.setApplicationName("dsl-scan")
    application.setDesktopFileName("dsl-scan")
    application.setStyle("Fusion")
    return application


def collect_garbage(window: MainWindow) -> GarbageCollector:
    """Collect garbage in the window's thread only, from now on."""
    collector = GarbageCollector(lambda: bool(window.parts.runner.active))
    collector.start()
    Ticker(window, CHECK_MS, collector.check).start()
    return collector


def _remove_import_hook() -> None:
    """Undo PySide's import hook, which reads and keeps the source of every module to find ``snake_case`` use.

    The hook makes imports slower by a tenth and the process larger by a hundred megabytes.
    """
    builtins.__import__ = getattr(builtins, "__orig_import__", builtins.__import__)


def set_theme(name: str) -> Theme:
    """Give the whole application the colours of a theme by its name; returns them."""
    application = QApplication.instance()
    assert isinstance(application, QApplication)
    hints = application.styleHints()
    hints.setColorScheme(_SCHEMES[name])
    dark = name == "dark" or (name == "system" and hints.colorScheme() == Qt.ColorScheme.Dark)
    theme = DARK if dark else LIGHT
    application.setPalette(_palette(theme))
    return theme


def make_window(
    pages: Mapping[str, Callable[[], PageWidget]],
    folder: Path | None = None,
    theme: str | None = None,
    commands: Mapping[str, Callable[[], object]] | None = None,
    handlers: Mapping[Kind, Callable[[Path], object]] | None = None,
) -> MainWindow:
    """The window with its settings of a folder (default: the system's); unreadable ones are told by a toast.

    ``theme`` overrides that of the settings; see `MainWindow` for the rest. No page is open yet.
    """
    path = (folder or settings_folder()) / "settings.json"
    settings, trouble = load_settings(path)
    file = SettingsFile(settings, path)
    if theme is not None:
        settings.theme = theme  # type: ignore[assignment]
    records = LogRecords()
    logging.getLogger().addHandler(records)
    logging.getLogger("dsl_core").setLevel(logging.INFO)
    parts = Parts(settings, file, records, QtRunner(), UndoStack(), set_theme, RecentFiles(settings))
    settings.page = settings.page if settings.page in pages else next(iter(pages))
    window = MainWindow(parts, pages, commands or {}, handlers or {})
    records.setParent(window)
    parts.runner.setParent(window)
    window.setWindowIcon(app_icon(window.theme))
    if trouble:
        window.toasts.tell("warning", trouble)
    return window


def open_first_page(window: MainWindow, imports: Mapping[str, Sequence[str]] | None = None) -> None:
    """Open the page that was open last: now, or after the first paint if ``imports`` lists its modules.

    These are then imported by a thread first; another page may be chosen meanwhile.
    """
    if imports is None:
        window.open_page(window.page)
        return

    def show(_: object) -> None:
        window.open_page(window.page)

    def begin() -> None:
        modules = imports[window.page]
        # A failing import fails again while the page is made, where the person is told.
        job = Job("Open the page", lambda progress: import_early(modules), show, show, is_minor=True)
        window.parts.runner.submit(job)

    window.painted.connect(begin)


class ExceptionHook(QObject):
    """Turns uncaught errors of any thread into a toast and a log entry; the window stays usable."""

    #: Emitted in the thread of the error, received in that of the window.
    caught = Signal(str)

    def __init__(self, notifier: Notifier) -> None:
        super().__init__()
        self.caught.connect(lambda text: notifier.tell("error", text))

    def install(self) -> None:
        """Replace Python's hooks."""
        sys.excepthook = self.handle
        threading.excepthook = lambda args: self.handle(
            args.exc_type, args.exc_value or args.exc_type(), args.exc_traceback
        )

    def handle(
        self, kind: type[BaseException], error: BaseException, traceback: TracebackType | None
    ) -> None:
        """Log an exception and show it."""
        if issubclass(kind, KeyboardInterrupt):
            application = QApplication.instance()
            if application is not None:
                application.quit()
            return
        _log.error("Unexpected error: %s", error, exc_info=(kind, error, traceback))
        self.caught.emit(
            f"Unexpected error ({kind.__name__}: {error}). Your data are safe; the log has the details"
            " (Help, Save a report bundle).",
        )


def _palette(theme: Theme) -> QPalette:
    palette = QPalette()
    roles = QPalette.ColorRole
    for role, colour in (
        (roles.Window, theme.window),
        (roles.WindowText, theme.text),
        (roles.Base, theme.base),
        (roles.AlternateBase, theme.window),
        (roles.Text, theme.text),
        (roles.PlaceholderText, theme.muted),
        (roles.Button, theme.raised),
        (roles.ButtonText, theme.text),
        (roles.ToolTipBase, theme.raised),
        (roles.ToolTipText, theme.text),
        (roles.Highlight, theme.accent),
        (roles.HighlightedText, theme.on_accent),
        (roles.Link, theme.accent),
        (roles.Accent, theme.accent),
    ):
        palette.setColor(role, QColor(colour))
    for role in (roles.WindowText, roles.Text, roles.ButtonText):
        palette.setColor(QPalette.ColorGroup.Disabled, role, QColor(theme.muted))
    return palette


def app_icon(theme: Theme) -> QIcon:
    """The application's own icon."""
    return icon("results", theme.accent)
