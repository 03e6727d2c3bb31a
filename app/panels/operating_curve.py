"""What accuracy costs in time: measured plans as points, the one at hand to be dragged between them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import pyqtgraph as pg
from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import QHBoxLayout, QVBoxLayout, QWidget

from app.theme import DARK, Theme
from app.widgets.forms import ChoiceBox, label
from app.widgets.plots import calm_plot, theme_plots
from dsl_core.evaluation.operating_points import OperatingPoints
from dsl_core.model.presets import PRESETS

#: Points that are always named; the others only while they are chosen or pointed at.
NAMED = ("preview", "balanced", "reference")
#: Names closer than this share of the axis would overlap.
NEAR = 0.15
TITLES = {preset.key: preset.title for preset in PRESETS}


@dataclass(frozen=True)
class Figure:
    """A figure of `OperatingPoint`, how it is called, and the value that it should have."""

    field: str
    title: str
    axis: str
    wanted: float = 0.0


FIGURES = (
    Figure("chart_rmse", "Reflectance of chart patches", "RMSE"),
    Figure("chart_pixel_rmse", "Reflectance of single pixels", "RMSE"),
    Figure("filter_fwhm_nm", "Width of 10 nm filters", "FWHM (nm)", 10.0),
    Figure("depth_rmse_mm", "Depth of single pixels", "RMSE (mm)"),
)


class OperatingCurve(QWidget):
    """Emits ``chosen`` with a preset's key when its point is clicked or the marker dropped near it."""

    chosen = Signal(str)

    def __init__(self, table: OperatingPoints | None) -> None:
        super().__init__()
        self._table = table
        self._seconds: Mapping[str, float] = {}
        self._current, self._own_s = "", 0.0
        self._theme = DARK
        self._labels: dict[str, Any] = {}
        self.figure = ChoiceBox("Figure of accuracy", "The figure that the curve shows")
        for figure in FIGURES:
            self.figure.addItem(figure.title)
        self.figure.setCurrentIndex(0)
        # In a small window the title beside it is worth more than its end.
        self.figure.setMinimumWidth(120)
        self.plot = calm_plot(
            "Accuracy against time",
            "Measured plans. Click a point or drag the marker to choose one; below and left is better.",
            "RMSE", "Time on the rig (min)",
        )  # fmt: skip
        self.plot.setMouseEnabled(False, False)
        self._front = self.plot.plot([], [])
        self.points = pg.ScatterPlotItem(size=9, hoverable=True, hoverSize=13, tip=None)
        self.marker = pg.TargetItem(size=18, movable=True)
        self._own = pg.InfiniteLine(angle=90, movable=False)
        self._wanted = pg.InfiniteLine(angle=0, movable=False)
        for item in (self._wanted, self._own, self.points, self.marker):
            self.plot.addItem(item, ignoreBounds=True)
        self._note = label("" if table is None else table.origin, "muted")
        self._note.setWordWrap(True)
        self._lay_out()
        self.figure.currentIndexChanged.connect(lambda _: self._draw())
        self.points.sigClicked.connect(lambda _item, spots, _event: self.chosen.emit(spots[0].data()))
        self.points.sigHovered.connect(self._hovered)
        self.marker.sigPositionChanged.connect(self._dragged)
        self.marker.sigPositionChangeFinished.connect(self._dropped)

    def _lay_out(self) -> None:
        head = QHBoxLayout()
        head.addWidget(label("Accuracy against time", "heading"))
        head.addStretch(1)
        head.addWidget(self.figure)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(4)
        column.addLayout(head)
        column.addWidget(self.plot, 1)
        column.addWidget(self._note)

    def show_plans(self, seconds: Mapping[str, float], current: str, own_s: float) -> None:
        """Show what each preset takes on the rig at hand, and which one is chosen ("" for an own plan)."""
        if (dict(seconds), current, own_s) == (self._seconds, self._current, self._own_s):
            return
        self._seconds, self._current, self._own_s = dict(seconds), current, own_s
        self._draw()

    @property
    def _figure(self) -> Figure:
        return FIGURES[self.figure.currentIndex()]

    def _spots(self) -> dict[str, tuple[float, float]]:
        if self._table is None:
            return {}
        return {
            key: (self._seconds[key] / 60, float(getattr(point, self._figure.field)))
            for key, point in self._table.points.items()
            if key in self._seconds
        }

    def _draw(self) -> None:
        figure, spots, theme = self._figure, self._spots(), self._theme
        self.plot.setLabel("left", figure.axis)
        self._wanted.setPos(figure.wanted)
        self._wanted.setVisible(figure.wanted > 0)
        for text in self._labels.values():
            self.plot.removeItem(text)
        self._labels = {}
        if not spots:
            self._note.setText("No measured plans came with this program, so that no curve can be shown.")
            self.marker.hide()
            return
        front = _front(spots, figure.wanted)
        self._front.setData(*zip(*front, strict=True))
        self.points.setData(
            [{"pos": at, "data": key, "brush": theme.accent, "pen": theme.base} for key, at in spots.items()]
        )
        self._set_ranges(spots, figure.wanted)
        for key in self._named(spots):
            self._name(key, spots)
        self._own.setPos(self._own_s / 60)
        self._own.setVisible(self._current not in spots)
        self.marker.setVisible(self._current in spots)
        if self._current in spots:
            self._place_marker(spots)

    def _named(self, spots: dict[str, tuple[float, float]]) -> list[str]:
        """Points with names; the one at hand pushes out those beside it."""
        current, right = spots.get(self._current), max(x for x, _ in spots.values())
        others = [
            key for key in NAMED
            if key in spots and (current is None or abs(spots[key][0] - current[0]) > NEAR * right)
        ]  # fmt: skip
        return others if current is None else [*others, self._current]

    def _set_ranges(self, spots: dict[str, tuple[float, float]], wanted: float) -> None:
        right = max(*(x for x, _ in spots.values()), self._own_s / 60)
        values = [y for _, y in spots.values()]
        low = min(*values, wanted) * 0.95 if wanted else 0.0
        self.plot.setXRange(0, right * 1.12, padding=0)
        self.plot.setYRange(low, low + (max(*values, wanted) - low) * 1.3, padding=0)

    def _name(self, key: str, spots: dict[str, tuple[float, float]]) -> None:
        colour = self._theme.text if key == self._current else self._theme.muted
        # A name near the left edge must not leave the plot.
        share = spots[key][0] / max(x for x, _ in spots.values())
        text = pg.TextItem(TITLES[key], color=colour, anchor=(min(3 * share, 0.5), 1.25))
        text.setPos(*spots[key])
        self.plot.addItem(text, ignoreBounds=True)
        self._labels[key] = text

    def _place_marker(self, spots: dict[str, tuple[float, float]]) -> None:
        self.marker.blockSignals(True)
        self.marker.setPos(*spots[self._current])
        self.marker.blockSignals(False)

    def _nearest(self) -> str:
        """The point nearest to the marker on the screen."""
        (width, height), at = self.plot.getViewBox().viewPixelSize(), self.marker.pos()
        spots = self._spots()
        return min(
            spots,
            key=lambda key: (
                ((spots[key][0] - at.x()) / width) ** 2 + ((spots[key][1] - at.y()) / height) ** 2
            ),
        )

    def _dragged(self) -> None:
        nearest = self._nearest()
        if nearest not in self._labels:
            self._name(nearest, self._spots())

    def _dropped(self) -> None:
        nearest = self._nearest()
        if nearest == self._current:
            self._place_marker(self._spots())
        else:
            self.chosen.emit(nearest)

    def _hovered(self, _item: object, spots: Any, _event: object) -> None:
        if len(spots):
            key = spots[0].data()
            if key not in self._labels:
                self._name(key, self._spots())

    def apply_theme(self, theme: Theme) -> None:
        """Take the colours of a theme."""
        self._theme = theme
        theme_plots((self.plot,), theme)
        self._front.setPen(pg.mkPen(theme.accent, width=1.5))
        self._own.setPen(pg.mkPen(theme.warn, width=1, style=Qt.PenStyle.DashLine))
        self._wanted.setPen(pg.mkPen(theme.muted, width=1, style=Qt.PenStyle.DashLine))
        self.marker.setPen(pg.mkPen(theme.text, width=2))
        self.marker.setHoverPen(pg.mkPen(theme.warn, width=2))
        self._draw()


def _front(spots: dict[str, tuple[float, float]], wanted: float) -> list[tuple[float, float]]:
    """The points that no quicker one beats, from quick to slow."""
    best, front = float("inf"), []
    for x, y in sorted(spots.values()):
        if abs(y - wanted) < best:
            best = abs(y - wanted)
            front.append((x, y))
    return front
