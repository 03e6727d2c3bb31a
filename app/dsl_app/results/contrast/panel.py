"""The histogram of the picture shown, on which its contrast is dragged."""

from __future__ import annotations

from typing import Any

import pyqtgraph as pg
from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QColor, QMouseEvent
from PySide6.QtWidgets import QWidget

from dsl_app.results.contrast.controller import ContrastController
from dsl_app.results.contrast.histogram import Histogram, histogram_of
from dsl_app.results.layers import Layers
from dsl_app.results.state import ResultsState
from dsl_app.shared.evented import follow_any
from dsl_app.shared.theme import DARK, Theme
from dsl_app.shared.widgets.forms import NumberBox, label, push_button, quiet
from dsl_app.shared.widgets.layouts import STRETCH, column_of, row_of
from dsl_app.shared.widgets.plots import RGB_COLOURS, CalmPlot

#: Height of the histogram, and how opaque its bars are, of 255.
HEIGHT_PX, OPACITY = 104, 150
NO_LEVELS = "This picture is of classes: there is no contrast to set."


class _Plot(CalmPlot):
    """A plot that tells of a double click."""

    double_clicked = Signal()

    def mouseDoubleClickEvent(self, event: QMouseEvent) -> None:
        """Tell of it, whatever item is there."""
        self.double_clicked.emit()
        event.accept()


class ContrastPanel(QWidget):
    """Follows a state while it is visible, and asks its controller for the levels that are dragged."""

    def __init__(self, state: ResultsState, control: ContrastController) -> None:
        super().__init__()
        self._state, self._control = state, control
        self._layers: Layers | None = None
        self._theme = DARK
        self._shown: Histogram | None = None
        tip = "Drag the two lines: what becomes black and what white. Double-click for the picture's own."
        self.plot = _Plot("Histogram of the picture", tip, "", "")
        self.plot.setFixedHeight(HEIGHT_PX)
        self.plot.setMouseEnabled(False, False)
        item = self.plot.getPlotItem()
        item.hideAxis("left")
        item.setYRange(0, 1.05, padding=0)
        # Room for half of the outermost numbers.
        item.setContentsMargins(8, 4, 14, 0)
        self._bars: list[Any] = []
        self.levels = pg.LinearRegionItem(swapMode="sort")
        self.levels.setZValue(10)
        item.addItem(self.levels)
        self.low = NumberBox(
            "Darkest value", -1e5, 1e5, 0.0, "", 3, "What becomes black, or the first colour"
        )
        self.high = NumberBox(
            "Brightest value", -1e5, 1e5, 1.0, "", 3, "What becomes white, or the last colour"
        )
        self.reset = push_button(
            "Automatic", "The picture's own contrast (double-click the histogram)", self._reset
        )
        self.none = label(NO_LEVELS, "muted", wraps=True)
        self._lay_out()
        self.levels.sigRegionChanged.connect(lambda: self._set(*self.levels.getRegion()))
        self.plot.double_clicked.connect(self._reset)
        for box in (self.low, self.high):
            box.valueChanged.connect(lambda _: self._set(self.low.value(), self.high.value()))
        state.result.follow(self._new_result)
        followed = (state.view, state.cloud_by, state.band, state.quality, state.picture, state.depth_limits)
        follow_any(self.show_levels, *followed, state.bands, state.levels, state.contrast)

    def _lay_out(self) -> None:
        low, high = (
            row_of(label(text), STRETCH, box) for text, box in (("From", self.low), ("to", self.high))
        )
        boxes = column_of(low, high, self.reset, STRETCH, spacing=4)
        row_of((self.plot, 1), self.none, boxes, on=self, margins=(0, 4, 0, 0))

    def _new_result(self, result: Any) -> None:
        self._layers = None if result is None else Layers(result)
        self.show_levels()

    def show_levels(self) -> None:
        """Show the histogram of the picture of the state; hide if it is not wanted."""
        self.setVisible(self._state.contrast.value)
        if self._layers is None or not self._state.contrast.value:
            return
        shown = histogram_of(self._layers.layer(self._state))
        self._shown = shown
        for widget in (self.plot, self.low, self.high, self.reset):
            widget.setVisible(shown is not None)
        self.none.setVisible(shown is None)
        if shown is not None:
            self._paint(shown)

    def _paint(self, shown: Histogram) -> None:
        item = self.plot.getPlotItem()
        colours = RGB_COLOURS if len(shown.heights) == 3 else (self._theme.muted,)
        for bar in self._bars:
            item.removeItem(bar)
        self._bars = []
        for colour, heights in zip(colours, shown.heights, strict=True):
            brush = QColor(colour)
            brush.setAlpha(OPACITY if len(colours) == 1 else OPACITY // 2)
            bar = pg.PlotDataItem(
                shown.edges, heights, stepMode="center", fillLevel=0, brush=brush, pen=pg.mkPen(colour)
            )
            self._bars.append(bar)
            item.addItem(bar)
        item.setXRange(shown.edges[0], shown.edges[-1], padding=0)
        self.plot.setLabel("bottom", shown.label)
        decimals, suffix = (2, f" {shown.unit}") if shown.unit else (3, "")
        with quiet(self.levels, self.low, self.high):
            self.levels.setRegion(shown.levels)
            for box, value in zip((self.low, self.high), shown.levels, strict=True):
                box.fit(*shown.levels, decimals)
                box.setSuffix(suffix)
                box.setSingleStep((shown.edges[-1] - shown.edges[0]) / 50)
                box.setValue(value)
        self.reset.setEnabled(shown.can_reset)

    def _set(self, low: float, high: float) -> None:
        if self._shown is not None:
            self._control.set_levels(self._shown.key, (float(low), float(high)))

    def _reset(self) -> None:
        if self._shown is not None:
            self._control.set_levels(self._shown.key, None)

    def apply_theme(self, theme: Theme) -> None:
        """Apply the colours of a theme."""
        self._theme = theme
        self.plot.apply_theme(theme)
        for line in self.levels.lines:
            line.setPen(pg.mkPen(theme.accent, width=2))
            line.setHoverPen(pg.mkPen(theme.text, width=3))
            line.setCursor(Qt.CursorShape.SizeHorCursor)
        shade = QColor(theme.accent)
        shade.setAlpha(28)
        self.levels.setBrush(shade)
        self.levels.setHoverBrush(shade)
        self.show_levels()
