"""The curve of accuracy against time: plans as points, the current one draggable along the best."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import pyqtgraph as pg
from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import QWidget

from dsl_app.scan.forecast.figures import CURVES, ForecastFigure
from dsl_app.scan.forecast.state import ForecastPoint
from dsl_app.shared.theme import DARK, Theme
from dsl_app.shared.widgets.forms import ChoiceBox, quiet
from dsl_app.shared.widgets.layouts import STRETCH, column_of, row_of
from dsl_app.shared.widgets.plots import CalmPlot, ticks, time_ticks

#: Presets that are always labelled; other points only while chosen or pointed at.
NAMED = ("preview", "balanced", "reference")
#: Labels closer than this, in decades of time, would overlap.
NEAR = 0.3
#: Room around the points, in decades.
ROOM = 0.09


class OperatingCurve(QWidget):
    """Emits ``chosen`` for the plan clicked, dropped on or reached by keys, ``pointed`` while moving."""

    chosen = Signal(object)
    pointed = Signal(object)

    def __init__(self) -> None:
        super().__init__()
        self._points: tuple[ForecastPoint, ...] = ()
        self._current: ForecastPoint | None = None
        self._theme = DARK
        self._labels: dict[int, Any] = {}
        self._is_fixed = False
        self.figure = ChoiceBox("Figure of accuracy", "The figure that the curve shows")
        for figure in CURVES:
            self.figure.addItem(figure.title)
        self.plot = CalmPlot(
            "Accuracy against time",
            "Expected error against capture time; lower left is better. Click a point, drag the marker"
            " along the curve, or press the arrow keys. The star is the published plan.",
            "RMSE", "Capture time", left_width=60,
        )  # fmt: skip
        self.plot.setMouseEnabled(False, False)
        self.plot.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self._front = self.plot.plot([], [])
        self.points = pg.ScatterPlotItem(hoverable=True, hoverSize=12, tip=None)
        self.marker = pg.TargetItem(size=18, movable=True)
        self._wanted = pg.InfiniteLine(angle=0, movable=False)
        for item in (self._wanted, self.points, self.marker):
            self.plot.addItem(item, ignoreBounds=True)
        self.marker.hide()
        self._lay_out()
        self.figure.currentIndexChanged.connect(lambda _: self._draw())
        self.points.sigClicked.connect(lambda _item, spots, _event: self._choose(spots[0].data()))
        self.points.sigHovered.connect(self._hovered)
        self.marker.sigPositionChanged.connect(lambda: self.pointed.emit(self._nearest()))
        self.marker.sigPositionChangeFinished.connect(self._dropped)

    def _lay_out(self) -> None:
        self.head = head = row_of(self.figure, STRETCH)
        column_of(head, (self.plot, 1), on=self, margins=0, spacing=4)

    # Show ------------------------------------------------------------------------------------------

    def show_points(self, points: Sequence[ForecastPoint], current: ForecastPoint | None) -> None:
        """Show predictions and which plan is current."""
        self._points, self._current = tuple(points), current
        self._draw()

    def fix(self, fixed: bool) -> None:
        """Disable choices while a scan is running."""
        self._is_fixed = fixed
        self.marker.movable = not fixed

    @property
    def _figure(self) -> ForecastFigure:
        return CURVES[self.figure.currentIndex()]

    def spot(self, point: ForecastPoint) -> tuple[float, float] | None:
        """The position of a point on the logarithmic axes; None if it lacks the figure."""
        value = getattr(point.expected, self._figure.field)
        return None if not value else (math.log10(point.expected.seconds), math.log10(value))

    def _seen(self) -> list[tuple[ForecastPoint, tuple[float, float]]]:
        return [(each, at) for each in self._points if (at := self.spot(each)) is not None]

    def front(self) -> list[ForecastPoint]:
        """The plans that no quicker one beats, quickest first."""
        wanted = self._figure.target
        best, found = float("inf"), []
        for point, at in sorted(self._seen(), key=lambda each: each[1]):
            off = abs(10 ** at[1] - wanted)
            if off < best:
                best = off
                found.append(point)
        return found

    def _draw(self) -> None:
        figure, seen, theme = self._figure, self._seen(), self._theme
        for text in self._labels.values():
            self.plot.removeItem(text)
        self._labels = {}
        self.plot.setLabel("left", figure.axis)
        self._wanted.setVisible(figure.target > 0 and bool(seen))
        self.marker.setVisible(False)
        line = [at for point in self.front() if (at := self.spot(point)) is not None]
        self._front.setData([x for x, _ in line], [y for _, y in line])
        self.points.setData([self._spot_of(point, at, theme) for point, at in seen])
        if not seen:
            for side in ("bottom", "left"):
                self.plot.getPlotItem().getAxis(side).setTicks([[]])
            return
        if figure.target:
            self._wanted.setPos(math.log10(figure.target))
        self._set_ranges([at for _, at in seen])
        for point in self._named():
            self._name(point)
        at = None if self._current is None else self.spot(self._current)
        self.marker.setVisible(at is not None)
        if at is not None:
            self._place_marker(at)

    @staticmethod
    def _spot_of(point: ForecastPoint, at: tuple[float, float], theme: Theme) -> dict[str, Any]:
        symbol, size, brush = "o", 6, theme.muted
        if point.is_published:
            symbol, size, brush = "star", 16, theme.warn
        elif point.preset:
            size, brush = 10, theme.accent
        place = {"pos": at, "data": point, "pen": theme.base}
        return {**place, "symbol": symbol, "size": size, "brush": brush}

    def _named(self) -> list[ForecastPoint]:
        """Labelled points; the current one hides labels that would overlap its own."""
        at = None if self._current is None else self.spot(self._current)
        named = [] if at is None or self._current is None else [self._current]
        for point, place in self._seen():
            if point.preset in NAMED and (at is None or abs(place[0] - at[0]) > NEAR):
                named.append(point)
        return named

    def _set_ranges(self, places: list[tuple[float, float]]) -> None:
        wanted = self._figure.target
        low, high = min(y for _, y in places), max(y for _, y in places)
        if wanted:
            low, high = min(low, math.log10(wanted)), max(high, math.log10(wanted))
        left, right = min(x for x, _ in places), max(x for x, _ in places)
        # Labels are above their points.
        top = high + max(0.2 * (high - low), ROOM)
        self.plot.setXRange(left - ROOM, right + ROOM, padding=0)
        self.plot.setYRange(low - ROOM / 2, top, padding=0)
        item = self.plot.getPlotItem()
        item.getAxis("bottom").setTicks([time_ticks(10 ** (left - ROOM), 10 ** (right + ROOM))])
        item.getAxis("left").setTicks([ticks(10 ** (low - ROOM / 2), 10**top)])

    def _name(self, point: ForecastPoint) -> None:
        at = self.spot(point)
        if at is None or point.key in self._labels:
            return
        is_current = self._current is not None and point.key == self._current.key
        (left, right), _ = self.plot.getViewBox().viewRange()
        # A label near an edge must not leave the plot.
        share = (at[0] - left) / (right - left)
        text = pg.TextItem(
            point.title, color=self._theme.text if is_current else self._theme.muted, anchor=(share, 1.25)
        )
        text.setPos(*at)
        self.plot.addItem(text, ignoreBounds=True)
        self._labels[point.key] = text

    def _place_marker(self, at: tuple[float, float]) -> None:
        with quiet(self.marker):
            self.marker.setPos(*at)

    # Choose ----------------------------------------------------------------------------------------

    def _nearest(self) -> ForecastPoint | None:
        """The preset or point of the curve nearest to the marker on the screen."""
        (width, height), at = self.plot.getViewBox().viewPixelSize(), self.marker.pos()
        worth = {point.key for point in self.front()}
        near = [each for each in self._seen() if each[0].preset or each[0].key in worth]
        if not near:
            return None
        return min(
            near, key=lambda each: math.hypot((each[1][0] - at.x()) / width, (each[1][1] - at.y()) / height)
        )[0]

    def _dropped(self) -> None:
        nearest = self._nearest()
        self.pointed.emit(None)
        if nearest is None or nearest == self._current:
            self._draw()
        else:
            self._choose(nearest)

    def _choose(self, point: ForecastPoint) -> None:
        if not self._is_fixed:
            self.chosen.emit(point)

    def _hovered(self, _item: object, spots: Any, _event: object) -> None:
        point = spots[0].data() if len(spots) else None
        if point is not None:
            self._name(point)
        self.pointed.emit(point)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Left and right choose quicker and slower plans of the curve."""
        step = {Qt.Key.Key_Left: -1, Qt.Key.Key_Right: 1}.get(Qt.Key(event.key()), 0)
        line = self.front()
        if not step or not line:
            event.ignore()
            return
        now = -1.0 if self._current is None else self._current.expected.seconds
        later = [point for point in line if (point.expected.seconds - now) * step > 0]
        if later:
            self._choose(later[0] if step > 0 else later[-1])

    def apply_theme(self, theme: Theme) -> None:
        """Take the colours of a theme."""
        self._theme = theme
        self.plot.apply_theme(theme)
        self._front.setPen(pg.mkPen(theme.accent, width=1.5))
        self._wanted.setPen(pg.mkPen(theme.muted, width=1, style=Qt.PenStyle.DashLine))
        self.marker.setPen(pg.mkPen(theme.text, width=2))
        self.marker.setHoverPen(pg.mkPen(theme.warn, width=2))
        self._draw()
