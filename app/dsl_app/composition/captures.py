"""Imports captures of other programs, and opens what was made of them."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from PySide6.QtCore import Qt

from dsl_app.shared.widgets.inside import apply_theme_inside
from dsl_app.shell.main_window import MainWindow

if TYPE_CHECKING:
    from dsl_app.importing.captures.dialog import CapturesDialog
    from dsl_app.importing.captures.state import Imported


class CapturesAction:
    """Shows the dialog, one at a time."""

    def __init__(self, window: MainWindow) -> None:
        self._window = window
        self._dialog: CapturesDialog | None = None

    def look(self, folder: Path) -> None:
        """Show what a folder of pictures is, which was chosen or dropped."""
        self._shown().open_folder(folder)

    def _shown(self) -> CapturesDialog:
        from dsl_app.importing.captures.controller import CapturesController
        from dsl_app.importing.captures.dialog import CapturesDialog
        from dsl_app.importing.captures.state import CapturesState

        if self._dialog is not None:
            self._dialog.raise_()
            return self._dialog
        window = self._window
        state = CapturesState(window.parts.settings.scans)
        state.done.connect(self._show)
        control = CapturesController(state, window.parts.runner)
        self._dialog = dialog = CapturesDialog(state, control, window)
        dialog.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        apply_theme_inside(dialog, window.theme)
        dialog.finished.connect(self._forget)
        dialog.open()
        return dialog

    def _forget(self) -> None:
        self._dialog = None

    def _show(self, imported: Imported) -> None:
        """Open the depth, or offer to reconstruct a scan that has only columns so far."""
        window = self._window
        text = f"{imported.scan.name} is imported. {imported.verdict}"
        window.open_path(imported.result or imported.scan)
        if imported.result is not None:
            window.toasts.tell("info", text)
        else:
            window.toasts.offer(text, {"Choose a calibration…": lambda: window.do("reconstruct_again")})
