"""Actions that ask in a dialog and open their outcome on a page: import, and reconstruct again."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

from PySide6.QtCore import Qt

from dsl_app.composition.captures import CapturesAction
from dsl_app.shared.known_files import has_pictures
from dsl_app.shared.widgets.inside import apply_theme_inside
from dsl_app.shared.widgets.open_dialog import ALL, SCANS, OpenDialog
from dsl_app.shell.main_window import MainWindow

if TYPE_CHECKING:
    from dsl_app.importing.controller import ImportController
    from dsl_app.importing.dialog import ImportDialog
    from dsl_app.results.reconstruct_again.controller import ReconstructionController
    from dsl_app.results.reconstruct_again.state import Reconstructed

#: Pages that the new result replaces; on other pages it is offered instead.
REPLACED_PAGES = ("results", "scan")


class ImportAction:
    """Imports a folder of another program: asks which and how, and opens what was made of it.

    The dialog depends on the folder: one in the published layout has a table of what is missing or misnamed,
    and ``captures`` shows what the pictures of any other are taken for.
    """

    def __init__(self, window: MainWindow, captures: CapturesAction) -> None:
        self._window, self.captures = window, captures
        self._dialog: ImportDialog | None = None

    @cached_property
    def control(self) -> ImportController:
        """The controller, made when it is first needed."""
        from dsl_app.importing.controller import ImportController
        from dsl_app.importing.state import ImportState

        control = ImportController(ImportState(), self._window.parts.runner, self._window.toasts)
        control.state.ready.connect(lambda _: self._ask())
        control.state.done.connect(self._window.open_path)
        return control

    def begin(self) -> None:
        """Choose a folder and look at it; the dialog follows."""
        title = "Import a folder of pictures, or a scan or calibration in the published layout"
        folder = OpenDialog.ask_folder(self._window, title, str(self._home))
        if folder is not None:
            self.look(folder)

    def look(self, folder: Path) -> None:
        """Look at a folder that was chosen or dropped; the dialog follows."""
        if not has_pictures(folder):
            self.control.look(folder, self._home if self._dialog is None else self._dialog.folder_to_save_in)
            return
        if self._dialog is not None:
            self._dialog.reject()
        self.captures.look(folder)

    @property
    def _home(self) -> Path:
        return self._window.parts.settings.scans

    def _ask(self) -> None:
        from dsl_app.importing.dialog import ImportDialog

        if self._dialog is not None:
            # It follows the state, which is about the other folder now.
            return
        self._dialog = dialog = ImportDialog(self.control.state, self.control, self._window)
        dialog.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        apply_theme_inside(dialog, self._window.theme)
        dialog.other_chosen.connect(self.look)
        dialog.finished.connect(self._forget)
        dialog.open()

    def _forget(self) -> None:
        self._dialog = None


class ReconstructAgainAction:
    """Reconstructs the scan of a page again: asks how, and opens the new result next to the old one."""

    def __init__(self, window: MainWindow) -> None:
        self._window = window

    @cached_property
    def control(self) -> ReconstructionController:
        """The controller, made when it is first needed."""
        from dsl_app.results.reconstruct_again.controller import ReconstructionController
        from dsl_app.results.reconstruct_again.state import ReconstructionState

        control = ReconstructionController(
            ReconstructionState(), self._window.parts.runner, self._window.toasts
        )
        control.state.ready.connect(lambda _: self._ask())
        control.state.done.connect(self._show)
        return control

    def begin(self) -> None:
        """Look at the scan of the open page, or at one that is chosen; the dialog follows."""
        window = self._window
        path = window.page_of(window.page).subject() or self._choose()
        if path is not None:
            self.control.prepare(path)

    def _choose(self) -> Path | None:
        title = "Choose the scan to reconstruct again (NAME.dsl)"
        folder = self._window.parts.settings.output_folder
        return OpenDialog.ask(self._window, title, folder, filters=(SCANS, ALL))

    def _ask(self) -> None:
        from dsl_app.results.reconstruct_again.dialog import ReconstructionDialog

        dialog = ReconstructionDialog(self.control.state, self.control, self._window)
        dialog.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        dialog.open()

    def _show(self, done: Reconstructed) -> None:
        from dsl_app.results.page import ResultsPage

        window, page = self._window, self._window.page_of("results")
        assert isinstance(page, ResultsPage)
        replaces, opens = window.page in REPLACED_PAGES, not page.is_busy
        window.parts.recent.add(done.result)
        offers: dict[str, Callable[[], object]] = {}

        def show() -> None:
            window.open_page("results")
            if not opens:
                window.open_path(done.result)

        if opens:
            page.open_path(done.result)
        if opens and replaces:
            window.open_page("results")
        else:
            offers["Show result"] = show
        text = f"{done.result.name} is {'open on the Results page' if opens else 'saved'}."
        if done.before is not None:
            before = done.before
            offers["Compare both"] = lambda: self._compare(before, done.result)
            text += f" Compare it with {before.name} on the Compare page."
        window.toasts.offer(text, offers)

    def _compare(self, first: Path, second: Path) -> None:
        from dsl_app.compare.page import ComparePage

        page = self._window.open_page("compare")
        assert isinstance(page, ComparePage)
        page.compare(first, second)
