"""Two results, or one and its ground truth: pictures and difference above, spectra and figures below."""

from __future__ import annotations

from pathlib import Path

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QSizePolicy, QSplitter, QWidget

from dsl_app.compare.pair.controller import PairController
from dsl_app.compare.pair.pictures import PairControls, PairPictures
from dsl_app.compare.pair.sides import PairSides
from dsl_app.compare.pair.state import Pair, PairState, pair_display
from dsl_app.compare.verdict_table import VerdictTable
from dsl_app.shared.evented import follow_any
from dsl_app.shared.paths import there
from dsl_app.shared.settings import RecentFiles
from dsl_app.shared.spectrum import spectrum_of_pixel
from dsl_app.shared.theme import Theme
from dsl_app.shared.widgets.clipped_label import ClippedLabel
from dsl_app.shared.widgets.deferred import Deferred
from dsl_app.shared.widgets.forms import push_button, remark_line, set_role, show_parts
from dsl_app.shared.widgets.help_window import set_help
from dsl_app.shared.widgets.layouts import STRETCH, boxed, column_of, row_of, splitter
from dsl_app.shared.widgets.open_dialog import ALL, RESULTS, OpenDialog
from dsl_app.shared.widgets.plots import CalmPlot, colour_legend
from dsl_app.shared.widgets.recent_list import RecentList
from dsl_app.shared.widgets.save_dialog import ask_place
from dsl_app.shared.widgets.spectrum_curve import SpectrumCurve

RESULT_SUFFIX = ".zarr"
#: Width of a name at least, px.
NAME_PX = 60


class PairPanel(QWidget):
    """Follows a `PairState` and asks its controller."""

    def __init__(self, state: PairState, control: PairController, recent: RecentFiles) -> None:
        super().__init__()
        self._state, self._control = state, control
        self.recent = RecentList(recent, self._use, self._is_free)
        self.name_a, self.name_b = _name(), _name()
        self.open_first = push_button("Open &A…", "Choose a result as A", lambda: self._choose(second=False))
        self.open_second = push_button("Open &B…", "Choose a result to compare A with")
        self.truth = push_button(
            "&Truth as B", "Use the ground truth of A's scene as B; only for scans of the simulated rig"
        )
        self.at_hand = push_button(
            "Open result", "Compare the result that is open on the Results page", self._use_at_hand
        )
        self.swap = push_button("S&wap", "Swap A and B", control.swap)
        self.report = push_button(
            "Write re&port…", "Save figures and pictures of the comparison as an HTML page"
        )
        self.hint = remark_line()
        # Slow to make: made when they are first seen.
        self.pictures = Deferred(lambda: PairPictures(state, control))
        self.bar = PairControls(state, control)
        self.figures = Deferred(lambda: PairFigures(state))
        self._lay_out()
        self._connect()

    def _lay_out(self) -> None:
        head = row_of(
            self.name_a,
            self.open_first,
            self.at_hand,
            24,
            self.name_b,
            self.open_second,
            self.truth,
            STRETCH,
            self.swap,
            self.report,
        )
        above = boxed(column_of((self.pictures, 1), self.bar, margins=0))
        self.parts = splitter(Qt.Orientation.Vertical, (above, 1), (self.figures, 1), sizes=(1000, 1000))
        self.empty = PairSides(self._state, self.recent)
        column_of(head, self.hint, (self.parts, 1), (self.empty, 1), on=self, margins=(0, 8, 0, 0))

    def _connect(self) -> None:
        state, control = self._state, self._control
        self.open_second.clicked.connect(lambda: self._choose(second=True))
        self.truth.clicked.connect(control.use_truth)
        self.report.clicked.connect(self._choose_report)
        self.stops = [
            state.pair.follow(lambda pair: self.parts.setVisible(pair is not None)),
            state.pair.follow(lambda pair: self.empty.setVisible(pair is None)),
            *follow_any(self.recent.fill, state.first, state.second),
            *follow_any(
                self._show, state.first, state.second, state.pair, state.busy, state.trouble, state.at_hand
            ),
        ]

    def _choose(self, second: bool) -> None:
        path = OpenDialog.ask(self, f"Open a result as {'B' if second else 'A'}", filters=(RESULTS, ALL))
        if path is not None:
            self._control.open_side(path, second)

    def _use_at_hand(self) -> None:
        path = self._state.at_hand.value
        if path is not None:
            self._control.open_side(path, second=self._state.first.value is not None)

    def _is_free(self, path: Path) -> bool:
        """Whether a recent file is a result that is not compared yet."""
        sides = self._state.first.value, self._state.second.value
        taken = [side.arrays.path for side in sides if side is not None]
        return path.suffix == RESULT_SUFFIX and there(path) and path not in taken

    def _use(self, path: Path) -> None:
        self._control.open_side(path, second=self._state.first.value is not None)

    def _choose_report(self) -> None:
        pair = self._state.pair.value
        if pair is None:
            return
        start = pair.first.arrays.path.with_suffix(".html")
        path = ask_place(self, "Write the report", str(start), "Web page (*.html)")
        if path is not None:
            self._control.write_report(path, pair)

    def _show(self) -> None:
        show_parts(self, pair_display(self._state))


def _name() -> ClippedLabel:
    """The name of a side, whole where there is room, else cut in its middle."""
    made = ClippedLabel()
    made.setSizePolicy(QSizePolicy.Policy.Maximum, made.sizePolicy().verticalPolicy())
    made.setMinimumWidth(NAME_PX)
    set_role(made, "heading")
    return made


class PairFigures(QSplitter):
    """Both spectra under the cursor, and the figures of A against B."""

    def __init__(self, state: PairState) -> None:
        super().__init__(Qt.Orientation.Horizontal)
        self._state = state
        self.plot = CalmPlot(
            "Spectra of A and B", "Reflectance under the cursor: A solid with its 95 % band, B dotted",
            "Reflectance", "Wavelength (nm)",
        )  # fmt: skip
        self.plot.setXRange(430, 660, padding=0.02)
        self.plot.setYRange(0, 1, padding=0.02)
        self.curves = [SpectrumCurve(self.plot.getPlotItem(), with_band=i == 0) for i in range(2)]
        self.legend = self.plot.addLegend(offset=(-12, 4), colCount=2, horSpacing=20)
        for curve, name in zip(self.curves, "AB", strict=True):
            self.legend.addItem(curve.solid, name)
        self.table = VerdictTable("Figures of the comparison", "Differences are A minus B")
        set_help(self.table, "comparing#figures")
        self.setChildrenCollapsible(False)
        self.addWidget(self.plot)
        self.addWidget(self.table)
        # The figures break their lines where they get less than a third.
        for place, share in enumerate((2, 1)):
            self.setStretchFactor(place, share)
        self.setSizes([2000, 1000])
        self.stops = [
            state.pair.follow(self._show_pair),
            state.cursor.follow(lambda _: self._show_cursor()),
        ]

    def _show_pair(self, pair: Pair | None) -> None:
        self.table.show_verdicts(() if pair is None else pair.rows)
        sides = () if pair is None else (pair.first, pair.second)
        bands_nm = [nm for side in sides for nm in side.arrays.wavelengths_nm]
        if bands_nm:
            self.plot.setXRange(min(bands_nm), max(bands_nm), padding=0.02)
        self._show_cursor()

    def _show_cursor(self) -> None:
        pair, pixel = self._state.pair.value, self._state.cursor.value
        for i, curve in enumerate(self.curves):
            side = None if pair is None else (pair.first, pair.second)[i]
            curve.set_spectrum(
                None if side is None or pixel is None else spectrum_of_pixel(side.arrays, pixel)
            )
        self.legend.setVisible(pair is not None and pixel is not None)

    def apply_theme(self, theme: Theme) -> None:
        """Apply the colours of a theme."""
        self.plot.apply_theme(theme)
        self.curves[0].set_colour(theme.pins[0], width=2)
        self.curves[1].set_colour(theme.pins[1], width=2, dashed=True)
        colour_legend(self.legend, theme.text)
