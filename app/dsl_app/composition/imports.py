"""Imports a folder of another program: asks which and how, and opens what came of it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QFileDialog

from dsl_app.shell.main_window import MainWindow

if TYPE_CHECKING:
    from dsl_app.importing.controller import TakeInController
    from dsl_app.importing.dialog import TakeInDialog


class TakeInDesk:
    """Makes controller and dialog when they are first wanted."""

    def __init__(self, window: MainWindow) -> None:
        self._window = window
        self._control: TakeInController | None = None
        self._dialog: TakeInDialog | None = None

    @property
    def control(self) -> TakeInController:
        """What decides."""
        if self._control is None:
            from dsl_app.importing.controller import TakeInController
            from dsl_app.importing.state import TakeInState

            parts = self._window.parts
            self._control = TakeInController(TakeInState(), parts.runner, self._window.toasts)
            self._control.state.ready.connect(lambda _: self._ask())
            self._control.state.done.connect(self._window.open_path)
        return self._control

    def begin(self) -> None:
        """Choose a folder and look at it; the dialog follows."""
        title = "Import a folder of images or a calibration"
        name = QFileDialog.getExistingDirectory(self._window, title, str(self._home))
        if name:
            self.look(Path(name))

    def look(self, folder: Path) -> None:
        """Look at a folder, which was chosen or dropped; the dialog follows."""
        self.control.look(folder, self._home)

    @property
    def _home(self) -> Path:
        return Path(self._window.parts.settings.output_folder or Path.home() / "dsl-scans")

    def _ask(self) -> None:
        from dsl_app.importing.dialog import TakeInDialog

        if self._dialog is not None:
            # It follows the state, which is about the other folder now.
            return
        self._dialog = dialog = TakeInDialog(self.control.state, self.control, self._window)
        dialog.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        dialog.apply_theme(self._window.theme)
        dialog.finished.connect(self._forget)
        dialog.open()

    def _forget(self) -> None:
        self._dialog = None
