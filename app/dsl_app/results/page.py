"""The Results page: picture or cloud on the left, spectra, marks and search on the right."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from PySide6.QtCore import Qt, QUrl, Signal
from PySide6.QtGui import QDesktopServices, QShowEvent
from PySide6.QtWidgets import QDialog, QStackedWidget, QWidget

from dsl_app.results.answers.colours_panel import ColoursPanel
from dsl_app.results.answers.materials_panel import MaterialsPanel
from dsl_app.results.cloud.panel import CloudPanel
from dsl_app.results.contrast.panel import ContrastPanel
from dsl_app.results.controller import ResultsController
from dsl_app.results.export.dialog import ExportDialog
from dsl_app.results.image import ResultImage
from dsl_app.results.intensity_window import IntensityWindow
from dsl_app.results.marks.library_dialog import LibraryDialog
from dsl_app.results.marks.panel import MarksPanel
from dsl_app.results.pixel_info import PixelInfo
from dsl_app.results.search.panel import SearchPanel
from dsl_app.results.spectrum_panel import SpectrumPanel
from dsl_app.results.state import Library, ResultsState, ResultView
from dsl_app.results.summary import summarise
from dsl_app.results.view_bar import ViewBar
from dsl_app.results.welcome import Offer, Welcome
from dsl_app.shared.evented import follow_any
from dsl_app.shared.jobs.base import JobRunner
from dsl_app.shared.plain_tip import plain_tip
from dsl_app.shared.settings import folder_for
from dsl_app.shared.theme import DARK, Theme
from dsl_app.shared.widget_state import LabelState
from dsl_app.shared.widgets.clipped_label import ClippedLabel
from dsl_app.shared.widgets.deferred import Deferred
from dsl_app.shared.widgets.figure_file import PlotFigure
from dsl_app.shared.widgets.forms import allow, label, push_button, show_label
from dsl_app.shared.widgets.help_window import set_help
from dsl_app.shared.widgets.layouts import HighArea, boxed, column_of, row_of, splitter, tabs_of
from dsl_app.shared.widgets.open_dialog import ALL, BOTH, OpenDialog
from dsl_app.shared.widgets.page import PageWidget
from dsl_app.shared.widgets.save_dialog import ask_target
from dsl_app.shared.widgets.ticker import Ticker
from dsl_app.shared.wording import short_name

if TYPE_CHECKING:
    from dsl_core.workflows.inspection import IntensityGraph

#: How often to ask for what a reconstruction has found, ms.
FETCH_MS = 100
#: Shares of the width for the picture and for what is next to it, by whether the window is wide.
SHARES = {False: (5, 3), True: (8, 3)}


class ResultsPage(PageWidget):
    """Follows a `ResultsState` and asks its controller.

    ``open_chosen`` carries a folder to open; ``reconstruct_again_requested`` asks to reconstruct the scan of
    the result with other parameters.
    """

    open_chosen = Signal(object)
    reconstruct_again_requested = Signal()

    def __init__(
        self, state: ResultsState, control: ResultsController, runner: JobRunner, welcome: Welcome
    ) -> None:
        """``welcome`` is shown while nothing is open."""
        super().__init__()
        self._state, self._control = state, control
        self._theme = DARK
        self.welcome, self.offer = welcome, Offer()
        self.bar = ViewBar(state, control)
        set_help(self.bar, "numbers#views")
        # Slow to make: made when they are first seen.
        self.image = Deferred(lambda: ResultImage(state, control))
        set_help(self.image, "numbers#below-the-picture")
        self.cloud = CloudPanel(state, control, runner)
        # Made when somebody wants it.
        self.contrast: ContrastPanel | None = None
        self.pixel_info = PixelInfo(state)
        set_help(self.pixel_info, "hard-cases")
        self.spectra = Deferred(lambda: SpectrumPanel(state))
        self.spectra.setObjectName("spectra")
        set_help(self.spectra, "numbers#spectra")
        self.marks = MarksPanel(state, control.marks)
        set_help(self.marks, "numbers#pins-regions-references")
        self.materials = Deferred(lambda: MaterialsPanel(state, control.answers))
        set_help(self.materials, "materials")
        self.colours = Deferred(lambda: ColoursPanel(state))
        set_help(self.colours, "materials#colours")
        self.search = Deferred(lambda: SearchPanel(state, control.search))
        set_help(self.search, "numbers#search")
        self._graph: IntensityWindow | None = None
        self.title, self.about = label("Results", "title"), ClippedLabel()
        self.warning = label("", "warn", wraps=True)
        self.reconstruct_again = push_button(
            "Reconstruct again…",
            "Make another result from the same frames, with other bands, solver or calibration (Ctrl+R)",
        )
        self._inspect = push_button(
            "Intensity graph",
            "Show what the pixel under the cursor received in each frame, and the model (I)",
        )
        self._open = push_button("Open…", "Open a result or a finished scan (Ctrl+O opens any file)")
        self._report = push_button(
            "Report…", "Write pictures, spectra, colours and materials of the marks as HTML page or PDF"
        )
        tip = "Write the result in formats of other programs (Ctrl+E)"
        self._export = push_button("Export…", tip, role="primary")
        self._lay_out()
        self._connect()

    @property
    def graph(self) -> IntensityWindow:
        """The window of intensity graphs, made on first use."""
        if self._graph is None:
            self._graph = IntensityWindow(self._state, self)
            self._graph.apply_theme(self._theme)
        return self._graph

    # Lay out ---------------------------------------------------------------------------------------

    def _lay_out(self) -> None:
        buttons = (self.reconstruct_again, self._inspect, self._open, self._report, self._export)
        head = row_of(self.title, 10, (self.about, 1), *buttons)
        greeting = boxed(column_of((self.welcome, 0, Qt.AlignmentFlag.AlignCenter)))
        self.stack = QStackedWidget()
        # In the order of `Content`.
        for content in (self.offer, self._content(), greeting):
            self.stack.addWidget(content)
        column_of(head, self.warning, (self.stack, 1), on=self, margins=(16, 10, 12, 8))

    def _content(self) -> QWidget:
        self.pictures = splitter(Qt.Orientation.Horizontal, (self.image, 1), (self.cloud, 1))
        self.pictures.setObjectName("result-pictures")
        self._below = column_of(margins=0)
        left = boxed(column_of(self.bar, (self.pictures, 1), self._below, self.pixel_info, margins=0))
        tabs = tabs_of(
            "Marks and answers",
            (self.marks, "Marks", "Pins, regions and references"),
            # In a low window they scroll: the plot stays as high with any of them.
            (HighArea(self.materials), "Materials", "Which material is where, with areas"),
            (HighArea(self.colours), "Colours", "Colours of the marks under several lights"),
            (HighArea(self.search), "Search", ""),
        )
        right = splitter(Qt.Orientation.Vertical, (self.spectra, 3), (tabs, 2), sizes=(350, 345))
        self._sides = splitter(Qt.Orientation.Horizontal, (left, 1), (right, 1))
        self.arrange()
        return self._sides

    def arrange(self) -> None:
        """Give the picture the room of a wide window; spectra and lists have enough with less of it."""
        for place, share in enumerate(SHARES[self.is_wide]):
            self._sides.setStretchFactor(place, share)
        self._sides.setSizes([1000 * share for share in SHARES[self.is_wide]])

    def _connect(self) -> None:
        control, state = self._control, self._state
        for button in (self._open, self.welcome.choose):
            button.clicked.connect(self.choose)
        self._export.clicked.connect(self.export)
        self._report.clicked.connect(self.report)
        self._inspect.clicked.connect(control.inspect)
        self.offer.reconstruct.clicked.connect(control.reconstruct)
        self.offer.later.clicked.connect(control.decline)
        for button in (self.reconstruct_again, self.offer.otherwise):
            button.clicked.connect(self.reconstruct_again_requested)
        follow_any(self._show_summary, state.result, state.offer, state.busy, state.is_begun)
        news = Ticker(self, FETCH_MS, control.take_news)
        state.busy.follow(lambda busy: news.run_while(bool(busy)))
        state.graph.changed.connect(self._show_graph)
        state.library.changed.connect(self._ask_library)
        state.opened.connect(lambda path: QDesktopServices.openUrl(QUrl.fromLocalFile(str(path))))
        state.contrast.follow(self._show_contrast)
        state.view.follow(lambda view: self.cloud.setVisible(view is ResultView.CLOUD))

    # Show ------------------------------------------------------------------------------------------

    def showEvent(self, event: QShowEvent) -> None:
        """Read the result again if it was replaced while another page was open."""
        super().showEvent(event)
        self._control.read_again()

    def _show_summary(self) -> None:
        state = self._state
        summary = summarise(state.result.value, state.offer.value, state.busy.value, state.is_begun.value)
        self.stack.setCurrentIndex(summary.content)
        self.offer.show_offer(summary.message, summary.can_reconstruct)
        for button in (self.reconstruct_again, self._inspect, self._report, self._export):
            allow(button, summary.has_result, state.hidden or "Open a result first.")
        self.title.setText(short_name(summary.title))
        self.title.setToolTip(plain_tip(summary.title))
        self.about.setText(summary.about)
        self.about.setToolTip(plain_tip(summary.details))
        show_label(self.warning, LabelState(summary.warning, "warn", summary.advice))

    def _show_graph(self, graph: IntensityGraph | None) -> None:
        if graph is None:
            if self._graph is not None:
                self._graph.hide()
        elif not self.graph.isVisible():
            self.graph.show()

    def _show_contrast(self, shown: bool) -> None:
        if shown and self.contrast is None:
            self.contrast = ContrastPanel(self._state, self._control.contrast)
            set_help(self.contrast, "numbers#contrast")
            self.contrast.apply_theme(self._theme)
            self._below.addWidget(self.contrast)

    def _ask_library(self, library: Library | None) -> None:
        if library is not None:
            self._open_dialog(LibraryDialog(library, self._control.marks, self))

    def _open_dialog(self, dialog: QDialog) -> None:
        dialog.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        dialog.open()

    def apply_theme(self, theme: Theme) -> None:
        """Apply the colours of a theme."""
        super().apply_theme(theme)
        self._theme = theme

    # Do --------------------------------------------------------------------------------------------

    def page_actions(self) -> dict[str, Callable[[], object]]:
        """Views, bands and export."""
        shows: dict[str, Callable[[], object]] = {
            view.value: lambda view=view: self._control.show(view)  # type: ignore[misc]
            for view in ResultView
        }
        return {
            **shows,
            "band_down": lambda: self._control.step_band(-1),
            "band_up": lambda: self._control.step_band(1),
            "intensity_graph": self._control.inspect,
            "copy_spectra": self.marks.copy_spectra,
            "export_spectra": self.marks.export_spectra,
            "export": self.export,
        }

    def choose(self) -> None:
        """Ask for a result or scan."""
        path = OpenDialog.ask(self, "Open a result (NAME.zarr) or a scan (NAME.dsl)", filters=(BOTH, ALL))
        if path is not None:
            self.open_chosen.emit(path)

    def export(self) -> None:
        """Open the export dialog."""
        control = self._control.export()
        if control is not None:
            self._open_dialog(ExportDialog(control, self))

    def report(self) -> None:
        """Ask for a file and write a report about what is marked."""
        # Another result may be opened while a person chooses.
        result, materials = self._control.shown_result(), self._state.materials.value
        marks = self._control.marks.listed
        if result is None:
            return
        draft = str(folder_for(result.path) / f"{result.path.stem}_report.html")
        kinds = "HTML page (*.html);;PDF (*.pdf)"
        target = ask_target(self, "Write a report", draft, kinds)
        if target is not None:
            self._control.answers.write_report(result, materials, *target, marks)

    def subject(self) -> Path | None:
        """The offered scan, or the open result."""
        result = self._state.result.value
        return self._state.offer.value or (None if result is None else result.path)

    def open_path(self, path: Path) -> bool:
        """Open a result, a scan or a reference."""
        return self._control.open(path)

    @property
    def is_busy(self) -> bool:
        """Whether nothing can be opened now, as a result is being opened or made."""
        return bool(self._state.busy.value)

    @property
    def is_reading(self) -> bool:
        """Whether a result or its marks are still being read."""
        return self._control.is_reading

    def command_line(self) -> str:
        """The command that reconstructs or exports what is open."""
        return self._control.command_line()

    def figure(self) -> PlotFigure | None:
        """The spectra, if there are any."""
        result, spectra = self._state.result.value, self.spectra.made
        if result is None or not result.has_spectra or spectra is None:
            return None
        name = f"{result.path.stem}_spectra"
        return PlotFigure(name, spectra.plot, spectra.apply_theme, spectra.named_curves)

    def unsaved(self) -> str:
        """The marks that cannot be saved, as on a full disk."""
        return self._control.marks.save_again()

    def release(self) -> None:
        """Release the graphics and stop following the recent files."""
        super().release()
        if self._graph is not None:
            self._graph.close()
        self.cloud.release()
