"""What the window does itself, of the table of actions: files, help, undo, jobs."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

from PySide6.QtWidgets import QFileDialog, QWidget

from dsl_app.shared.widgets.figure_file import FORMATS, save_figure
from dsl_app.shared.widgets.help_window import help_of, help_window
from dsl_app.shared.widgets.text_windows import command_window
from dsl_app.shell.about import about_window, shortcuts_window
from dsl_app.shell.actions import ACTIONS
from dsl_app.shell.paged_window import PagedWindow
from dsl_app.shell.report_bundle import write_report_bundle
from dsl_app.shell.tour import Tour
from dsl_app.shell.tour_steps import STEPS, Step
from dsl_core.errors import DslError

THEMES = ("system", "light", "dark")


class WindowActions:
    """Does for a window what neither its pages nor other parts of the program do."""

    def __init__(self, window: PagedWindow) -> None:
        self._window, self._parts, self._toasts = window, window.parts, window.toasts
        self._tour: Tour | None = None

    def all(self) -> dict[str, Callable[[], object]]:
        """What is done, by the key of the table."""
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
        name, _ = QFileDialog.getOpenFileName(self._window, "Open", self._parts.settings.output_folder)
        if name:
            self._window.open_path(Path(name))

    def _open_last(self) -> None:
        if self._parts.recent.paths.value:
            self._window.open_path(self._parts.recent.paths.value[0])
        else:
            self._toasts.tell("info", "Nothing was opened yet. Choose a file by File, Open.")

    def _refuse_export(self) -> None:
        self._toasts.tell("info", "There is nothing to export on this page. Open a result first.")

    def _save_figure(self) -> None:
        figure = self._window.page_of(self._window.page).figure()
        if figure is None:
            self._toasts.tell(
                "info",
                "There is no figure on this page. The spectra of a result can be saved, and on the Scan page"
                " what accuracy costs in time.",
            )
            return
        draft = str(Path(self._parts.settings.output_folder) / f"{figure.name}.svg")
        name, _ = QFileDialog.getSaveFileName(self._window, "Save the figure", draft, FORMATS)
        if not name:
            return
        try:
            save_figure(figure, Path(name), self._window.theme)
        except DslError as error:
            self._toasts.tell("error", str(error))
        else:
            self._toasts.tell("info", f"Saved as {name}.")

    def _save_report_bundle(self) -> None:
        name, _ = QFileDialog.getSaveFileName(
            self._window, "Save a report bundle", "dsl-scan-report.zip", "Zip (*.zip)"
        )
        if not name:
            return
        try:
            lines = [text for _, text in self._parts.records.lines]
            write_report_bundle(Path(name), lines, self._parts.settings)
        except DslError as error:
            self._toasts.tell("error", str(error))
        else:
            self._toasts.tell("info", f"Saved as {name}.")

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
            self._toasts.tell("info", "Open something on this page first; then its command is shown here.")

    def _explain(self) -> None:
        """Explain what has the focus, else the open page."""
        window = self._window
        help_window(help_of(window.focusWidget()) or window.about_page.help, window).show()

    def _start_tour(self) -> None:
        if self._tour is not None:
            return
        window = self._window
        self._tour = Tour([step for step in STEPS if step.page in window.pages], window.theme, window)
        self._tour.wanted.connect(self._show_step)
        self._tour.ended.connect(self._end_tour)
        self._tour.start()
        self._parts.settings.tour_seen = True

    def _show_step(self, step: Step) -> None:
        page = self._window.open_page(step.page)
        # Parts of a result are only there while one is open.
        target = self._window.findChild(QWidget, step.target)
        assert self._tour is not None
        self._tour.point_at(target if target is not None and target.isVisible() else page)

    def _end_tour(self) -> None:
        self._tour = None
