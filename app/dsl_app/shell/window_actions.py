"""The actions that the window does itself: files, undo, jobs, help."""

from __future__ import annotations

import json
import platform
import sys
import zipfile
from collections.abc import Callable, Iterable
from functools import partial
from importlib.metadata import distributions
from pathlib import Path

from PySide6.QtCore import Qt
from PySide6.QtGui import QKeySequence
from PySide6.QtWidgets import QDialog, QLabel, QTextBrowser, QWidget

from dsl_app.shared.settings import Settings
from dsl_app.shared.widgets.dialogs import command_window, text_window
from dsl_app.shared.widgets.figure_file import FORMATS, save_figure
from dsl_app.shared.widgets.forms import named
from dsl_app.shared.widgets.help_window import help_of, help_window
from dsl_app.shared.widgets.open_dialog import OpenDialog
from dsl_app.shared.widgets.save_dialog import ask_place
from dsl_app.shell.actions import ACTIONS, Action
from dsl_app.shell.paged_window import PagedWindow
from dsl_app.shell.tour import STEPS, Tour, TourStep
from dsl_core import __version__
from dsl_core.errors import DslError
from dsl_core.io.staging import staged

THEMES = ("system", "light", "dark")


class WindowActions:
    """Does the actions of a window that neither its pages nor the composition do."""

    def __init__(self, window: PagedWindow) -> None:
        self._window, self._parts, self._toasts = window, window.parts, window.toasts
        self._tour: Tour | None = None

    def all(self) -> dict[str, Callable[[], object]]:
        """Functions by the key of their action."""
        window, undo = self._window, self._parts.undo
        return {
            **{f"page_{key}": partial(window.open_page, key) for key in window.pages},
            **{f"theme_{name}": partial(window.apply_theme, name) for name in THEMES},
            "open": self._open,
            "open_last": self._open_last,
            "export": self._refuse_export,
            "save_figure": self._save_figure,
            "report_bundle": self._save_report_bundle,
            "quit": window.close,
            "undo": lambda: self._tell(undo.undo()),
            "redo": lambda: self._tell(undo.redo()),
            "cancel_jobs": self._cancel_jobs,
            "show_command": self._show_command,
            "help_page": self._explain,
            "tour": self._start_tour,
            "shortcuts": lambda: shortcuts_window(ACTIONS, window).open(),
            "about": lambda: about_window(window).open(),
        }

    def _tell(self, reason: str) -> None:
        """Say why something is not done, if there is a reason."""
        if reason:
            self._toasts.tell("info", reason)

    # Files -----------------------------------------------------------------------------------------

    def _open(self) -> None:
        path = OpenDialog.ask(self._window, "Open", self._parts.settings.output_folder)
        if path is not None:
            self._window.open_path(path)

    def _open_last(self) -> None:
        if self._parts.recent.paths.value:
            self._window.open_path(self._parts.recent.paths.value[0])
        else:
            self._toasts.tell("info", "Nothing has been opened yet. Use File, Open to choose a file.")

    def _refuse_export(self) -> None:
        self._toasts.tell("info", "There is nothing to export on this page. Open a result first.")

    def _save_figure(self) -> None:
        figure = self._window.page_of(self._window.page).figure()
        if figure is None:
            self._toasts.tell(
                "info",
                "There is no plot on this page. You can save the spectra of a result, and the curve of"
                " accuracy against time on the Scan page.",
            )
            return
        draft = str(Path(self._parts.settings.output_folder) / f"{figure.name}.svg")
        path = ask_place(self._window, "Save plot", draft, FORMATS)
        if path is None:
            return
        try:
            save_figure(figure, path, self._window.theme)
        except DslError as error:
            self._toasts.tell("error", str(error))
        else:
            self._toasts.tell("info", f"Saved as {path}.")

    def _save_report_bundle(self) -> None:
        path = ask_place(self._window, "Save report bundle", "dsl-scan-report.zip", "Zip (*.zip)")
        if path is None:
            return
        try:
            lines = [text for _, text in self._parts.records.lines]
            write_report_bundle(path, lines, self._parts.settings)
        except DslError as error:
            self._toasts.tell("error", str(error))
        else:
            self._toasts.tell("info", f"Saved as {path}.")

    # Jobs ------------------------------------------------------------------------------------------

    def _cancel_jobs(self) -> None:
        if not self._parts.runner.active:
            self._toasts.tell("info", "Nothing is running.")
        self._parts.runner.cancel_all()

    # Help ------------------------------------------------------------------------------------------

    def _show_command(self) -> None:
        command = self._window.page_of(self._window.page).command_line()
        if command:
            command_window(command, self._window).open()
        else:
            self._toasts.tell("info", "Open something on this page first, to see its command.")

    def _explain(self) -> None:
        """Show the help on the focused control, else on the open page."""
        window = self._window
        help_window(help_of(window.focusWidget()) or window.about_page.help, window).show()

    def _start_tour(self) -> None:
        if self._tour is not None:
            return
        window = self._window
        self._tour = Tour([step for step in STEPS if step.page in window.pages], window.theme, window)
        self._tour.step_changed.connect(self._show_step)
        self._tour.ended.connect(self._end_tour)
        self._tour.start()
        self._parts.settings.tour_seen = True

    def _show_step(self, step: TourStep) -> None:
        page = self._window.open_page(step.page)
        # Parts of a result only exist while one is open.
        target = self._window.findChild(QWidget, step.target)
        assert self._tour is not None
        self._tour.point_at(target if target is not None and target.isVisible() else page)

    def _end_tour(self) -> None:
        self._tour = None


def shortcuts_window(actions: Iterable[Action], parent: QWidget) -> QDialog:
    """Every action with its shortcut."""
    rows = [
        f"| {action.text.replace('&', '')} | {_keys(action)} | {action.tip} |"
        for action in actions
        if action.shortcut
    ]
    rows.append("| Continue | Enter | Presses the blue button of the page, or the button with the focus |")
    browser = named(QTextBrowser(), "Keyboard shortcuts", "Every action that has a shortcut")
    browser.setMarkdown("\n".join(["| Action | Shortcut | What it does |", "|---|---|---|", *rows]))
    return text_window("Keyboard shortcuts", browser, parent, 720, 620)


def _keys(action: Action) -> str:
    return QKeySequence(action.shortcut).toString(QKeySequence.SequenceFormat.NativeText)


def about_window(parent: QWidget) -> QDialog:
    """Name, version, reference and licence of the program."""
    from PySide6 import __version__ as qt_version

    text = QLabel()
    text.setTextFormat(Qt.TextFormat.RichText)
    text.setText(
        f"<h3>dsl-scan {__version__}</h3>"
        "<p>Hyperspectral 3D scanning by Dispersed Structured Light: an RGB camera, an RGB projector and a"
        " diffraction film.</p>"
        "<p>Method: S. Shin, S. Choi, F. Heide and S.-H. Baek, <i>Dispersed Structured Light for"
        " Hyperspectral 3D Imaging</i>, CVPR 2024.</p>"
        f"<p>BSD-3-Clause · Python {sys.version.split()[0]} · Qt {qt_version} (LGPL)</p>"
    )
    text.setWordWrap(True)
    text.setAlignment(Qt.AlignmentFlag.AlignTop)
    return text_window("About dsl-scan", text, parent, 460, 280)


def write_report_bundle(path: Path, lines: Iterable[str], settings: Settings) -> Path:
    """Write log, settings and versions as a zip file; replaces an existing one. Raises `StoreError`."""
    versions = sorted(f"{d.metadata['Name']}=={d.version}" for d in distributions())
    facts = {
        "dsl-scan": __version__,
        "python": sys.version,
        "system": platform.platform(),
        "packages": versions,
    }
    with (
        staged([path], overwrite=True) as (draft,),
        zipfile.ZipFile(draft, "w", zipfile.ZIP_DEFLATED) as bundle,
    ):
        bundle.writestr("log.txt", "\n".join(lines))
        bundle.writestr("settings.json", settings.model_dump_json(indent=1))
        bundle.writestr("versions.json", json.dumps(facts, indent=1))
    return path
