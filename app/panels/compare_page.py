"""The Compare page: A, B and their difference above, spectra under the cursor and figures below."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Protocol

import numpy as np
from PySide6.QtCore import Qt
from PySide6.QtGui import QDragEnterEvent, QDropEvent
from PySide6.QtWidgets import (
    QAbstractItemView,
    QFileDialog,
    QHBoxLayout,
    QHeaderView,
    QPushButton,
    QSlider,
    QSplitter,
    QTableWidget,
    QTableWidgetItem,
    QVBoxLayout,
    QWidget,
)

from app.panels.compare_view import CompareView
from app.state.compare import CompareState, Pair, Shown, Side
from app.state.results import Pixel, spectrum_of_pixel
from app.theme import Theme
from app.widgets.forms import ChoiceBox, label, set_role
from app.widgets.help_window import set_help
from app.widgets.page import PageWidget
from app.widgets.plots import calm_plot, theme_plots
from app.widgets.spectrum_curve import SpectrumCurve

NOTHING = (
    "Open a result as A, then another one as B, or take the truth of its twin as B."
    " Results (folders NAME.zarr) can be dropped here."
)

#: Room for the longest figure's name.
TABLE_PX = 400


class CompareCommands(Protocol):
    """What the page asks for."""

    def open(self, path: Path) -> bool:
        """Put a result on a free side."""

    def open_side(self, path: Path, second: bool) -> None:
        """Read a result as A or B."""

    def use_truth(self) -> None:
        """Take the truth of A as B."""

    def swap(self) -> None:
        """Let A and B change places."""

    def show(self, shown: Shown) -> None:
        """Show depth or a band."""

    def set_band(self, band: int) -> None:
        """Show a common band."""

    def point_at(self, pixel: Pixel) -> None:
        """Move the cursor."""

    def write_report(self, target: Path) -> None:
        """Write the report."""

    def command_line(self) -> str:
        """The command that does the same."""


class ComparePage(PageWidget):
    """Follows a `CompareState` and asks a controller."""

    def __init__(self, state: CompareState, commands: CompareCommands) -> None:
        super().__init__()
        self._state, self._commands = state, commands
        self.setAcceptDrops(True)
        self.names = [label("A: –", "heading"), label("B: –", "heading")]
        self.open_first = _button("Open &A…", "Choose the result to look at")
        self.open_second = _button("Open &B…", "Choose the result to compare it with")
        self.truth = _button(
            "&Truth as B", "Take what the twin knows of the scene of A, where a twin took it"
        )
        self.swap = _button("&Swap", "Let A and B change places")
        self.report = _button("Write &report…", "Figures and pictures of A against the truth as an HTML page")
        self.hint = label(NOTHING, "muted")
        self.hint.setWordWrap(True)
        self.shown = ChoiceBox("Pictures show", "Depth, or one band of reflectance")
        for each in Shown:
            self.shown.addItem(each.value, each)
        self.band = QSlider(Qt.Orientation.Horizontal)
        self.band.setAccessibleName("Band")
        self.band.setToolTip("The common band that the pictures show")
        self._nm, self._readout = label("", "muted"), label("", "muted")
        self._readout.setAccessibleName("Values under the cursor")
        self.view = CompareView(state)
        self.plot = calm_plot(
            "Spectra of A and B", "Reflectance under the cursor: A solid with its 95 % band, B dotted",
            "Reflectance", "Wavelength (nm)",
        )  # fmt: skip
        self.plot.setXRange(430, 660, padding=0.02)
        self.plot.setYRange(0, 1, padding=0.02)
        self._curves = [SpectrumCurve(self.plot.getPlotItem(), with_band=i == 0) for i in range(2)]
        self.table = _table()
        set_help(self.table, "comparing#figures")
        self._stops: list[Callable[[], None]] = []
        self._lay_out()
        self._connect()

    def _lay_out(self) -> None:
        head = QHBoxLayout()
        head.addWidget(self.names[0])
        head.addWidget(self.open_first)
        head.addSpacing(24)
        head.addWidget(self.names[1])
        for button in (self.open_second, self.truth):
            head.addWidget(button)
        head.addStretch(1)
        for button in (self.swap, self.report):
            head.addWidget(button)
        tools = QHBoxLayout()
        tools.addWidget(self.shown)
        self.band.setFixedWidth(260)
        tools.addWidget(self.band)
        tools.addWidget(self._nm)
        tools.addStretch(1)
        tools.addWidget(self._readout)
        above = QWidget()
        upper = QVBoxLayout(above)
        upper.setContentsMargins(0, 0, 0, 0)
        upper.addWidget(self.view, 1)
        upper.addLayout(tools)
        below = QSplitter(Qt.Orientation.Horizontal)
        below.setChildrenCollapsible(False)
        below.addWidget(self.plot)
        below.addWidget(self.table)
        below.setStretchFactor(0, 1)
        self.parts = QSplitter(Qt.Orientation.Vertical)
        self.parts.setChildrenCollapsible(False)
        for i, (widget, stretch) in enumerate(((above, 5), (below, 4))):
            self.parts.addWidget(widget)
            self.parts.setStretchFactor(i, stretch)
        column = QVBoxLayout(self)
        column.addLayout(head)
        column.addWidget(self.hint)
        column.addWidget(self.parts, 1)

    def _connect(self) -> None:
        state, commands = self._state, self._commands
        self.open_first.clicked.connect(lambda: self._choose(second=False))
        self.open_second.clicked.connect(lambda: self._choose(second=True))
        self.truth.clicked.connect(commands.use_truth)
        self.swap.clicked.connect(commands.swap)
        self.report.clicked.connect(self._choose_report)
        self.shown.activated.connect(lambda _: self._choose_shown())
        self.band.valueChanged.connect(commands.set_band)
        self.view.pointed.connect(commands.point_at)
        self._stops = [
            *self.view.stops,
            state.first.follow(lambda side: self._show_side(0, side)),
            state.second.follow(lambda side: self._show_side(1, side)),
            state.pair.follow(self._show_pair),
            state.shown.follow(lambda _: self._show_shown()),
            state.band.follow(lambda _: self._show_shown()),
            state.cursor.follow(lambda _: self._show_cursor()),
            state.busy.follow(lambda _: self._show_hint()),
            state.trouble.follow(lambda _: self._show_hint()),
        ]

    # Ask -------------------------------------------------------------------------------------------

    def _choose(self, second: bool) -> None:
        name = QFileDialog.getExistingDirectory(self, f"Open a result as {'B' if second else 'A'}")
        if name:
            self._commands.open_side(Path(name), second)

    def _choose_report(self) -> None:
        pair = self._state.pair.value
        if pair is None:
            return
        start = pair.first.arrays.path.with_suffix(".html")
        name, _ = QFileDialog.getSaveFileName(self, "Write the report", str(start), "Web page (*.html)")
        if name:
            self._commands.write_report(Path(name))

    def _choose_shown(self) -> None:
        self._commands.show(self.shown.currentData())
        # What was refused is shown as it is.
        self._show_shown()

    # Show ------------------------------------------------------------------------------------------

    def _show_side(self, i: int, side: Side | None) -> None:
        self.names[i].setText(f"{'AB'[i]}: {'–' if side is None else side.name}")
        self._show_hint()

    def _show_hint(self) -> None:
        state = self._state
        pair = state.pair.value
        text = state.trouble.value or (f"{state.busy.value}…" if state.busy.value else "")
        if not text and pair is None:
            text = NOTHING
        self.hint.setText(text)
        self.hint.setVisible(bool(text))
        set_role(self.hint, "bad" if state.trouble.value else "muted")
        idle = not state.busy.value
        truth = state.second.value is not None and state.second.value.truth is not None
        for button in (self.open_first, self.open_second):
            button.setEnabled(idle)
        self.truth.setEnabled(idle and state.first.value is not None)
        self.swap.setEnabled(idle and pair is not None and not truth)
        self.report.setEnabled(idle and pair is not None and truth)

    def _show_pair(self, pair: Pair | None) -> None:
        self.parts.setEnabled(pair is not None)
        rows = () if pair is None else pair.rows
        self.table.setRowCount(len(rows))
        for i, row in enumerate(rows):
            for column, text in enumerate((row.figure, row.value.replace("-", "−"), row.unit)):
                item = QTableWidgetItem(text)
                if column == 1:
                    item.setTextAlignment(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
                self.table.setItem(i, column, item)
        self.band.setRange(0, max(len(pair.bands) - 1, 0) if pair else 0)
        self._show_hint()
        self._show_shown()
        self._show_cursor()

    def _show_shown(self) -> None:
        state = self._state
        pair, in_band = state.pair.value, state.shown.value is Shown.BAND
        self.shown.setCurrentIndex(self.shown.findData(state.shown.value))
        self.band.setVisible(in_band)
        self._nm.setVisible(in_band)
        if pair is not None and pair.bands:
            self.band.blockSignals(True)
            self.band.setValue(state.band.value)
            self.band.blockSignals(False)
            self._nm.setText(f"{pair.nm(state.band.value):g} nm")
        self._show_readout()

    def _show_cursor(self) -> None:
        pair, pixel = self._state.pair.value, self._state.cursor.value
        for i, curve in enumerate(self._curves):
            side = None if pair is None else (pair.first, pair.second)[i]
            curve.set_spectrum(
                None if side is None or pixel is None else spectrum_of_pixel(side.arrays, pixel)
            )
        self._show_readout()

    def _show_readout(self) -> None:
        state = self._state
        pair, pixel = state.pair.value, state.cursor.value
        images = None if pair is None else pair.images(state.shown.value, state.band.value)
        if images is None or pixel is None:
            self._readout.setText("Move over a picture to compare values." if images else "")
            return
        a, b = (float(image[pixel[1], pixel[0]]) for image in images)
        decimals, unit = (2, " mm") if state.shown.value is Shown.DEPTH else (3, "")
        words = [
            f"{name} {_number(value, decimals)}{unit}"
            for name, value in (("A", a), ("B", b), ("A − B", a - b))
        ]
        self._readout.setText(f"column {pixel[0]}, row {pixel[1]}:   {'   '.join(words)}")

    # Page ------------------------------------------------------------------------------------------

    def dragEnterEvent(self, event: QDragEnterEvent) -> None:
        """Take folders."""
        if event.mimeData().hasUrls():
            event.acceptProposedAction()

    def dropEvent(self, event: QDropEvent) -> None:
        """Put what is dropped on a free side."""
        for url in event.mimeData().urls():
            path = Path(url.toLocalFile())
            if not self._commands.open(path):
                self._commands.open_side(path, second=False)

    def open_path(self, path: Path) -> bool:
        """Take a result, on a free side."""
        return self._commands.open(path)

    def command_line(self) -> str:
        """The command that compares A with its truth."""
        return self._commands.command_line()

    def apply_theme(self, theme: Theme) -> None:
        """Take the colours of a theme."""
        self.view.apply_theme(theme)
        theme_plots((self.plot,), theme)
        self._curves[0].set_colour(theme.pins[0], width=2)
        self._curves[1].set_colour(theme.pins[1], width=2, dashed=True)

    def release(self) -> None:
        """Follow nothing more."""
        for stop in self._stops:
            stop()


def _button(text: str, tip: str) -> QPushButton:
    button = QPushButton(text)
    button.setToolTip(tip)
    return button


def _table() -> QTableWidget:
    table = QTableWidget(0, 3)
    table.setHorizontalHeaderLabels(["Figure", "Value", "Unit"])
    table.setAccessibleName("Figures of the comparison")
    table.setToolTip("Differences are A minus B")
    table.setMinimumWidth(TABLE_PX)
    table.verticalHeader().hide()
    table.verticalHeader().setDefaultSectionSize(24)
    table.setEditTriggers(QAbstractItemView.EditTrigger.NoEditTriggers)
    table.setSelectionBehavior(QAbstractItemView.SelectionBehavior.SelectRows)
    header = table.horizontalHeader()
    header.setDefaultAlignment(Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter)
    header.setSectionResizeMode(0, QHeaderView.ResizeMode.Stretch)
    for column in (1, 2):
        header.setSectionResizeMode(column, QHeaderView.ResizeMode.ResizeToContents)
    return table


def _number(value: float, decimals: int) -> str:
    return "–" if not np.isfinite(value) else f"{value:.{decimals}f}".replace("-", "−")
