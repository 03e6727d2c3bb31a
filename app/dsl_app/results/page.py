"""The Results page: picture or cloud at the left, spectra and what was marked at the right."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import (
    QFileDialog,
    QHBoxLayout,
    QPushButton,
    QSplitter,
    QStackedWidget,
    QTabWidget,
    QVBoxLayout,
    QWidget,
)

from dsl_app.results.cloud.panel import ScenePanel
from dsl_app.results.commands import ResultCommands
from dsl_app.results.export_dialog import ExportDialog
from dsl_app.results.image import ResultImage
from dsl_app.results.intensity_window import IntensityWindow
from dsl_app.results.library_dialog import LibraryDialog
from dsl_app.results.marks.panel import MarksPanel
from dsl_app.results.readout import Readout
from dsl_app.results.rendered_words import rendered_words
from dsl_app.results.search_panel import SearchPanel
from dsl_app.results.spectrum_panel import SpectrumPanel
from dsl_app.results.state import Library, ResultsState, View
from dsl_app.results.view_bar import ViewBar
from dsl_app.results.welcome import Welcome
from dsl_app.shared.jobs.base import JobRunner
from dsl_app.shared.theme import DARK, Theme
from dsl_app.shared.widgets.deferred import Deferred
from dsl_app.shared.widgets.figure_file import Figure
from dsl_app.shared.widgets.forms import label
from dsl_app.shared.widgets.help_window import set_help
from dsl_app.shared.widgets.page import PageWidget
from dsl_core.workflows.inspection import IntensityGraph

#: What the page shows, by its place in the stack.
WAITING, CONTENT, WELCOME = range(3)


class ResultsPage(PageWidget):
    """Follows a `ResultsState` and asks a controller.

    ``open_chosen`` tells a folder to open, ``again_wanted`` that its scan is to be reconstructed
    in another way.
    """

    open_chosen = Signal(object)
    again_wanted = Signal()

    def __init__(
        self, state: ResultsState, commands: ResultCommands, runner: JobRunner, welcome: Welcome
    ) -> None:
        """``welcome`` is shown while nothing is open."""
        super().__init__()
        self._state, self._commands = state, commands
        self.welcome = welcome
        self.title, self.about = label("Results", "title"), label("", "muted")
        self.about.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        self.about.setSizePolicy(
            self.about.sizePolicy().Policy.Ignored, self.about.sizePolicy().verticalPolicy()
        )
        self.bar = ViewBar(state, commands)
        set_help(self.bar, "numbers#views")
        self._image = Deferred(self._make_image)
        set_help(self._image, "numbers#below-the-picture")
        self.scene = ScenePanel(state, runner)
        self.readout = Readout(state)
        set_help(self.readout, "hard-cases")
        self._spectra = Deferred(lambda: SpectrumPanel(state))
        self._spectra.setObjectName("spectra")
        set_help(self._spectra, "numbers#spectra")
        self.marks = MarksPanel(state, commands.marks)
        set_help(self.marks, "numbers#pins-regions-references")
        self.search = SearchPanel(state, commands)
        set_help(self.search, "numbers#search")
        self._graph: IntensityWindow | None = None
        self._theme = DARK
        self._panels = (self.bar, self._image, self.scene, self._spectra, self.marks)
        self.stack = QStackedWidget()
        self._open, self._export = QPushButton("Open…"), QPushButton("Export…")
        self._inspect = QPushButton("Intensity graph")
        self.again = QPushButton("Reconstruct again…")
        self._lay_out()
        self._connect()

    # Made when there is something to show ----------------------------------------------------------

    @property
    def image(self) -> ResultImage:
        """The picture."""
        return self._image.content

    @property
    def spectra(self) -> SpectrumPanel:
        """The spectra under the cursor and of what is marked."""
        return self._spectra.content

    def _make_image(self) -> ResultImage:
        commands, made = self._commands, ResultImage(self._state)
        made.pointed.connect(commands.point_at)
        made.pinned.connect(commands.marks.pin)
        made.outlined.connect(commands.marks.add_outline)
        made.moved.connect(commands.move_cursor)
        made.deleted.connect(self.marks.remove_selected)
        return made

    # Lay out ---------------------------------------------------------------------------------------

    def _lay_out(self) -> None:
        self._inspect.setToolTip("What the pixel under the cursor saw line by line, against the model (I)")
        self._open.setToolTip("Open a result or a finished scan (Ctrl+O opens any file)")
        self._export.setToolTip("Write the result in formats of other programs (Ctrl+E)")
        self.again.setToolTip(
            "Make another result of the same frames, with other bands, another solver or calibration (Ctrl+R)"
        )
        head = QHBoxLayout()
        head.addWidget(self.title)
        head.addSpacing(10)
        head.addWidget(self.about, 1)
        head.addWidget(self.again)
        head.addWidget(self._inspect)
        head.addWidget(self._open)
        head.addWidget(self._export)
        self.stack.addWidget(self._waiting())
        self.stack.addWidget(self._content())
        greeting = QWidget()
        QVBoxLayout(greeting).addWidget(self.welcome, 0, Qt.AlignmentFlag.AlignCenter)
        self.stack.addWidget(greeting)
        column = QVBoxLayout(self)
        column.setContentsMargins(16, 10, 12, 8)
        column.addLayout(head)
        column.addWidget(self.stack, 1)

    def _waiting(self) -> QWidget:
        waiting = QWidget()
        self.message = label("", "muted")
        self.message.setWordWrap(True)
        self.message.setAlignment(Qt.AlignmentFlag.AlignCenter)
        self.reconstruct = QPushButton("Reconstruct")
        self.reconstruct.setProperty("role", "primary")
        self.reconstruct.setToolTip(
            "Turn the frames into depth and spectra; the result is saved beside the scan"
        )
        self.otherwise = QPushButton("With other parameters…")
        self.otherwise.setToolTip("Choose bands, solver, calibration and name first (Ctrl+R)")
        column = QVBoxLayout(waiting)
        column.addStretch(1)
        column.addWidget(self.message)
        column.addSpacing(8)
        for button in (self.reconstruct, self.otherwise):
            column.addWidget(button, 0, Qt.AlignmentFlag.AlignHCenter)
        column.addStretch(2)
        return waiting

    def _content(self) -> QWidget:
        self.pictures = QSplitter(Qt.Orientation.Horizontal)
        self.pictures.setObjectName("result-pictures")
        self.pictures.addWidget(self._image)
        self.pictures.addWidget(self.scene)
        self.pictures.setStretchFactor(0, 1)
        self.pictures.setStretchFactor(1, 2)
        left = QWidget()
        column = QVBoxLayout(left)
        column.setContentsMargins(0, 0, 0, 0)
        column.addWidget(self.bar)
        column.addWidget(self.pictures, 1)
        column.addWidget(self.readout)
        tabs = QTabWidget()
        tabs.setDocumentMode(True)
        tabs.tabBar().setDrawBase(False)
        tabs.addTab(self.marks, "Pins, regions, references")
        tabs.addTab(self.search, "Look for")
        right = QSplitter(Qt.Orientation.Vertical)
        right.addWidget(self._spectra)
        right.addWidget(tabs)
        right.setStretchFactor(0, 3)
        right.setStretchFactor(1, 2)
        right.setSizes([400, 340])
        content = QSplitter(Qt.Orientation.Horizontal)
        content.addWidget(left)
        content.addWidget(right)
        content.setStretchFactor(0, 3)
        content.setStretchFactor(1, 2)
        content.setSizes([720, 440])
        for splitter in (content, right, self.pictures):
            splitter.setChildrenCollapsible(False)
        return content

    def _connect(self) -> None:
        commands, state = self._commands, self._state
        for button in (self._open, self.welcome.choose):
            button.clicked.connect(self.choose)
        self._export.clicked.connect(self.export)
        self._inspect.clicked.connect(self.inspect)
        for button in (self.again, self.otherwise):
            button.clicked.connect(self.again_wanted)
        state.graph.changed.connect(self._show_graph)
        state.library.changed.connect(self._ask_library)
        self.reconstruct.clicked.connect(commands.reconstruct)
        self.scene.pointed.connect(commands.point_at)
        self.scene.pinned.connect(commands.marks.pin)
        self.scene.outlined.connect(commands.marks.add_pixels)
        for value in (state.result, state.offer, state.busy):
            value.changed.connect(lambda _: self._show_state())
        state.view.follow(lambda view: self.scene.setVisible(view is View.CLOUD))
        self._show_state()

    # Show ------------------------------------------------------------------------------------------

    def _show_state(self) -> None:
        state, result = self._state, self._state.result.value
        waiting = bool(state.busy.value) or state.offer.value is not None
        self.stack.setCurrentIndex(WAITING if waiting else WELCOME if result is None else CONTENT)
        for button in (self.reconstruct, self.otherwise):
            button.setVisible(state.offer.value is not None and not state.busy.value)
        self.again.setEnabled(result is not None)
        self._export.setEnabled(result is not None)
        self._inspect.setEnabled(result is not None)
        if state.busy.value:
            self.message.setText(f"{state.busy.value} …")
        elif state.offer.value is not None:
            self.message.setText(f"{state.offer.value.name} is a scan without a result. Reconstruct it now?")
        if result is None:
            self.about.setText("")
            return
        height, width = result.shape
        bands = f" · {len(result.wavelengths_nm)} bands" if result.has_spectra else " · depth only"
        captured = str(result.attributes.get("captured", ""))[:16].replace("T", " ")
        effects, details = rendered_words(result.attributes)
        self.title.setText(result.path.stem)
        parts = (f"{width} × {height} px{bands}", captured, effects, str(result.path))
        self.about.setText(" · ".join(part for part in parts if part))
        self.about.setToolTip("\n\n".join(part for part in (str(result.path), details) if part))

    def apply_theme(self, theme: Theme) -> None:
        """Take the colours of a theme."""
        self._theme = theme
        for panel in self._panels:
            panel.apply_theme(theme)
        if self._graph is not None:
            self._graph.apply_theme(theme)

    # Do --------------------------------------------------------------------------------------------

    def page_actions(self) -> dict[str, Callable[[], object]]:
        """Views, bands and export."""
        shows: dict[str, Callable[[], object]] = {
            view.value: lambda view=view: self._commands.show(view)  # type: ignore[misc]
            for view in View
        }
        return {
            **shows,
            "band_down": lambda: self._commands.step_band(-1),
            "band_up": lambda: self._commands.step_band(1),
            "intensity_graph": self.inspect,
            "copy_spectra": self.marks.copy_spectra,
            "export_spectra": self.marks.export_spectra,
            "export": self.export,
        }

    def choose(self) -> None:
        """Choose the folder of a result or scan."""
        name = QFileDialog.getExistingDirectory(self, "Open a result (NAME.zarr) or a scan (NAME.dsl)")
        if name:
            self.open_chosen.emit(Path(name))

    def inspect(self) -> None:
        """Show what the pixel under the cursor saw; its window comes when that is known."""
        self._commands.inspect()

    @property
    def graph(self) -> IntensityWindow:
        """The window of intensity graphs; made when it is first wanted, since that takes a moment."""
        if self._graph is None:
            self._graph = IntensityWindow(self._state, self)
            self._graph.apply_theme(self._theme)
        return self._graph

    def _show_graph(self, graph: IntensityGraph | None) -> None:
        if graph is None:
            if self._graph is not None:
                self._graph.hide()
        elif not self.graph.isVisible():
            self.graph.show()

    def _ask_library(self, library: Library | None) -> None:
        if library is not None:
            dialog = LibraryDialog(library, self._commands.marks, self)
            dialog.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
            dialog.open()

    def export(self) -> None:
        """Ask for formats and write them."""
        if self._state.result.value is not None:
            dialog = ExportDialog(self._state, self._commands, self)
            dialog.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
            dialog.open()

    def subject(self) -> Path | None:
        """The scan that is offered, or the result that is open."""
        result = self._state.result.value
        return self._state.offer.value or (None if result is None else result.path)

    def open_path(self, path: Path) -> bool:
        """Open a result, a scan or a reference."""
        return self._commands.open(path)

    @property
    def is_reading(self) -> bool:
        """Whether a result or its marks are still being read."""
        return self._commands.is_reading

    def command_line(self) -> str:
        """The command that makes or exports what is open."""
        return self._commands.command_line()

    def figure(self) -> Figure | None:
        """The spectra, while there are any."""
        result, spectra = self._state.result.value, self._spectra.made
        if result is None or not result.has_spectra or spectra is None:
            return None
        name = f"{result.path.stem}_spectra"
        return Figure(name, spectra.plot, spectra.apply_theme, spectra.named_curves)

    def release(self) -> None:
        """Let go of the graphics context and of the recent files."""
        self.welcome.release()
        if self._graph is not None:
            self._graph.close()
        self.scene.release()
