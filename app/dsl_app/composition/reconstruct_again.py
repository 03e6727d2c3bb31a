"""Reconstructs again what a page shows: asks how, and opens the new result beside the old one."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QFileDialog

from dsl_app.shell.main_window import MainWindow

if TYPE_CHECKING:
    from dsl_app.results.again.controller import AgainController
    from dsl_app.results.again.state import AgainDone

#: Pages from which the new result is gone to; who works elsewhere is not torn away.
NEAR = ("results", "scan")


class AgainDesk:
    """Makes controller and dialog when they are first wanted."""

    def __init__(self, window: MainWindow) -> None:
        self._window = window
        self._control: AgainController | None = None

    @property
    def control(self) -> AgainController:
        """What decides."""
        if self._control is None:
            from dsl_app.results.again.controller import AgainController
            from dsl_app.results.again.state import AgainState

            parts = self._window.parts
            self._control = AgainController(AgainState(), parts.runner, self._window.toasts)
            self._control.state.ready.connect(lambda _: self._ask())
            self._control.state.done.connect(self._show)
        return self._control

    def begin(self) -> None:
        """Look at the scan that the open page is about, or at one that is chosen; the dialog follows."""
        window = self._window
        path = window.page_of(window.page).subject() or self._choose()
        if path is not None:
            self.control.prepare(path)

    def _choose(self) -> Path | None:
        title = "Choose the scan to reconstruct again (NAME.dsl)"
        name = QFileDialog.getExistingDirectory(
            self._window, title, self._window.parts.settings.output_folder
        )
        return Path(name) if name else None

    def _ask(self) -> None:
        from dsl_app.results.again.dialog import AgainDialog

        dialog = AgainDialog(self.control.state, self.control, self._window)
        dialog.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        dialog.open()

    def _show(self, done: AgainDone) -> None:
        window, near = self._window, self._window.page in NEAR
        window.page_of("results").open_path(done.result)
        window.parts.recent.add(done.result)
        if near:
            window.open_page("results")
        offers: dict[str, Callable[[], object]] = {}
        if not near:
            offers["Show it"] = lambda: window.open_page("results")
        text = f"{done.result.name} is open on the Results page."
        if done.before is not None:
            before = done.before
            offers["Compare both"] = lambda: self._compare(before, done.result)
            text += f" Compare shows it beside {before.name}."
        window.toasts.offer(text, offers)

    def _compare(self, first: Path, second: Path) -> None:
        from dsl_app.compare.page import ComparePage

        page = self._window.open_page("compare")
        assert isinstance(page, ComparePage)
        page.compare(first, second)
