"""A window with the intensity graph of a pixel: its colours in every frame, against the model."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import pyqtgraph as pg
from numpy.typing import NDArray
from PySide6.QtCore import QSize, Qt
from PySide6.QtGui import QShowEvent
from PySide6.QtWidgets import QDialog, QWidget

from dsl_app.results.state import ResultsState
from dsl_app.shared.theme import Theme
from dsl_app.shared.widgets.dialogs import use_room
from dsl_app.shared.widgets.forms import check_box, label
from dsl_app.shared.widgets.help_window import add_help_key
from dsl_app.shared.widgets.layouts import column_of
from dsl_app.shared.widgets.plots import MONO_COLOUR, RGB_COLOURS, CalmPlot, colour_legend
from dsl_core.model.plan import spoken_number

if TYPE_CHECKING:
    from dsl_core.workflows.inspection import IntensityGraph

COLOURS = dict(zip("RGB", RGB_COLOURS, strict=True))
#: Wavelengths that are labelled along the first orders, nm.
LABELLED_NM = 50.0
ORDER_NAMES = {1: "+1", -1: "−1"}
#: The upper end of the scale over the brightest signal: the legend stands above the curves.
HEADROOM = 1.25


class IntensityWindow(QDialog):
    """Follows the graph of a state; can stay open next to the picture."""

    def __init__(self, state: ResultsState, parent: QWidget) -> None:
        super().__init__(parent)
        self._page = parent
        self._graph = state.graph.value
        self.setWindowTitle("Intensity graph")
        use_room(self, parent, QSize(860, 440))
        add_help_key(self, "reading-an-intensity-graph")
        self.plot = CalmPlot(
            "Intensity graph",
            "Points are measured; lines are modelled from the reconstructed spectrum. The dashed line marks"
            " the zero order; the upper axis shows the wavelengths of the first orders.",
            "Signal (DN/ms)",
            "Frame of the line set",
        )
        self.item = self.plot.getPlotItem()
        self.item.showAxis("top")
        self.item.getAxis("top").enableAutoSIPrefix(False)
        # Measured points above their models, in the room that `_scale` leaves above the curves.
        self.item.addLegend(offset=(-10, 2), colCount=3, verSpacing=-6)
        self.zero = pg.InfiniteLine(angle=90, movable=False)
        self.item.addItem(self.zero, ignoreBounds=True)
        self.spans = {order: pg.LinearRegionItem(movable=False) for order in ORDER_NAMES}
        for span in self.spans.values():
            span.setZValue(-10)
            self.item.addItem(span, ignoreBounds=True)
        self.measured: list[Any] = []
        self.model: list[Any] = []
        self.faint = check_box(
            "Scale to the first orders",
            "The zero order is far brighter and extends beyond the plot; clear this to show all of it",
        )
        self.faint.setChecked(True)
        self.faint.toggled.connect(lambda _: self._scale())
        self.text = label("", "muted", wraps=True)
        column_of((self.plot, 1), self.faint, self.text, on=self)
        state.graph.follow(self._show)

    def showEvent(self, event: QShowEvent) -> None:
        """Stand in the lower right corner of the page: at the left is the picture that is pointed at."""
        super().showEvent(event)
        corner = self._page.mapToGlobal(self._page.rect().bottomRight())
        self.move(corner - self.rect().bottomRight())

    def _show(self, graph: IntensityGraph | None) -> None:
        self._graph = graph
        if graph is None:
            return
        self.setWindowTitle(f"Intensity graph of pixel {graph.pixel[0]}, {graph.pixel[1]}")
        frames = spoken_number(0) + np.arange(graph.measured.shape[1])
        self._make_curves(COLOURS if len(graph.measured) == len(COLOURS) else {"": MONO_COLOUR})
        for c in range(len(graph.measured)):
            self.measured[c].setData(frames, graph.measured[c])
            if graph.model is None:
                self.model[c].setData([], [])
            else:
                self.model[c].setData(frames, graph.model[c])
        self.zero.setVisible(graph.zero is not None)
        if graph.zero is not None:
            self.zero.setPos(spoken_number(0) + graph.zero)
        for order, span in self.spans.items():
            reached = known(graph.orders.get(order))
            span.setVisible(reached.size > 0)
            if reached.size:
                first = spoken_number(0)
                span.setRegion((first + float(reached.min()), first + float(reached.max())))
        self.item.getAxis("top").setTicks([ticks(graph)])
        self._scale()
        self.text.setText(graph_text(graph))

    def _make_curves(self, colours: Mapping[str, str]) -> None:
        """A curve each for measured and model of colours, which are named in the legend."""
        if len(colours) == len(self.measured):
            return
        for curve in (*self.measured, *self.model):
            self.item.removeItem(curve)
        points = {"pen": None, "symbol": "o", "symbolSize": 3, "symbolPen": None}
        self.measured = [
            self.item.plot(**points, symbolBrush=colour, name=f"{name} measured".strip())
            for name, colour in colours.items()
        ]
        self.model = [
            self.item.plot(pen=pg.mkPen(colour, width=1.4), name=f"{name} model".strip())
            for name, colour in colours.items()
        ]

    def _scale(self) -> None:
        graph = self._graph
        if graph is None:
            return
        last = graph.measured.shape[1] - 1
        self.item.setXRange(spoken_number(0), spoken_number(last), padding=0.02)
        top = faint_top(graph) if self.faint.isChecked() else float(np.nanmax(graph.measured))
        self.item.setYRange(
            min(float(np.nanpercentile(graph.measured, 1)), 0.0), HEADROOM * max(top, 1e-6), padding=0
        )

    def apply_theme(self, theme: Theme) -> None:
        """Apply the colours of a theme."""
        self.plot.apply_theme(theme)
        self.item.getAxis("top").setPen(theme.line)
        self.item.getAxis("top").setTextPen(theme.muted)
        colour_legend(self.item.legend, theme.text)
        self.zero.setPen(pg.mkPen(theme.text, width=1, style=Qt.PenStyle.DashLine))
        for span in self.spans.values():
            span.setBrush(pg.mkBrush(theme.accent + "22"))
            for line in span.lines:
                line.setPen(pg.mkPen(theme.line))


def known(values: NDArray[np.float64] | None) -> NDArray[np.float64]:
    """The values that are numbers."""
    return np.empty(0) if values is None else values[np.isfinite(values)]


def faint_top(graph: IntensityGraph) -> float:
    """The brightest signal of the first orders, measured or modelled; of all frames where none is reached."""
    spans = [known(frames) for frames in graph.orders.values()]
    curves = [graph.measured] if graph.model is None else [graph.measured, graph.model]
    parts = [
        curve[:, max(int(span.min()), 0) : int(span.max()) + 2]
        for span in spans
        if span.size > 0
        for curve in curves
    ]
    return float(max(np.nanmax(part) for part in parts)) if parts else float(np.nanmax(graph.measured))


def ticks(graph: IntensityGraph) -> list[tuple[float, str]]:
    """Ticks of the upper axis: round wavelengths of the first orders, and the zero order.

    As on the lower one, frames are counted from 1.
    """
    found = []
    for frames in graph.orders.values():
        round_nm = np.isclose(graph.wavelengths_nm % LABELLED_NM, 0)
        for nm, frame in zip(graph.wavelengths_nm[round_nm], frames[round_nm], strict=True):
            if np.isfinite(frame):
                found.append((float(frame), f"{nm:g}"))
    if graph.zero is not None:
        found.append((graph.zero, "zero order"))
    return [(spoken_number(0) + frame, text) for frame, text in found]


def graph_text(graph: IntensityGraph) -> str:
    """The graph in a sentence or two."""
    reached = [name for order, name in ORDER_NAMES.items() if known(graph.orders.get(order)).size]
    parts = []
    if graph.zero is not None:
        parts.append(_reached_text(reached))
        parts.append("The upper axis is in nm.")
    if graph.model is None:
        parts.append("The pixel has no spectrum, so there is no model to compare with.")
    else:
        of_colours = " and colours" if len(graph.measured) == len(COLOURS) else ""
        miss = float(np.sqrt(np.nanmean((graph.measured - graph.model) ** 2)))
        parts.append(f"Measured and model differ by {miss:.3g} DN/ms (RMS over all frames{of_colours}).")
    return " ".join(parts)


def _reached_text(reached: list[str]) -> str:
    match reached:
        case []:
            return "No first order reaches the pixel."
        case [order]:
            return f"First order {order} reaches the pixel."
    return f"First orders {' and '.join(reached)} reach the pixel."
