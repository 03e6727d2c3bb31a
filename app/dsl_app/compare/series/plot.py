"""The series as a plot: deviations over stage positions, or an error over capture time, with error bars."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QWidget

from dsl_app.compare.series.state import SeriesKind, SeriesState
from dsl_app.shared.evented import follow_any
from dsl_app.shared.theme import DARK, Theme
from dsl_app.shared.widgets.forms import label
from dsl_app.shared.widgets.layouts import column_of
from dsl_app.shared.widgets.plots import CalmPlot, ticks
from dsl_core.evaluation.stage_test import StageLine, StageTest
from dsl_core.evaluation.time_sweep import SweepPoint, best_points
from dsl_core.model.figure import with_std_in_places
from dsl_core.solve.normal import BAND_95

#: Room around points, as a share of their range, and at least so many decades.
ROOM, ROOM_DECADES = 0.12, 0.08


class SeriesPlot(QWidget):
    """Follows a `SeriesState`."""

    def __init__(self, state: SeriesState) -> None:
        super().__init__()
        self._state, self._theme = state, DARK
        self.plot = CalmPlot(
            "Series",
            "Depth: distance minus the fitted line over positions, with 95 % bars. Time: an error over the"
            " capture time, both logarithmic; lower and further left is better.",
            "", "", left_width=60,
        )  # fmt: skip
        self.plot.setMouseEnabled(False, False)
        self.legend = label("", "muted", wraps=True)
        self.legend.setTextFormat(Qt.TextFormat.RichText)
        column_of(self.legend, (self.plot, 1), on=self, margins=0, spacing=2)
        self.stops = follow_any(self.draw, state.rows, state.test, state.kind, state.figure)

    def draw(self) -> None:
        """Draw the state."""
        item = self.plot.getPlotItem()
        item.clear()
        self.legend.setText("")
        test, points = self._state.test.value, self._state.points
        if self._state.kind.value is SeriesKind.SWEEP:
            item.setLabel("bottom", "Capture time (s)")
            self._draw_sweep(points)
            return
        item.setLabel("bottom", "Stage position (mm)")
        item.setLabel("left", "Distance − line (mm)")
        for side in ("bottom", "left"):
            item.getAxis(side).setTicks(None if test is not None else [[]])
        if test is not None:
            self._draw_stage(test)

    # Depth test ------------------------------------------------------------------------------------

    def _draw_stage(self, test: StageTest) -> None:
        theme, order = self._theme, np.argsort(test.positions_mm)
        at, half = np.array(test.positions_mm)[order], BAND_95 * np.array(test.std_mm)[order]
        self._line(0.0)
        reach = 0.0
        for line, colour, symbol in ((test.fixed, theme.pins[1], "s"), (test.free, theme.pins[0], "o")):
            off = np.array(line.deviations_mm)[order]
            reach = max(reach, float((np.abs(off) + half).max()))
            self.plot.addItem(pg.PlotCurveItem(at, off, pen=pg.mkPen(colour, width=1)))
            self.plot.addItem(pg.ErrorBarItem(x=at, y=off, height=2 * half, beam=0.0, pen=colour))
            self.plot.addItem(pg.ScatterPlotItem(x=at, y=off, size=8, symbol=symbol, brush=colour, pen=None))
        self.legend.setText(
            f"{_key('●', theme.pins[0])} slope free, {_straight(test.free)} &nbsp; "
            f"{_key('■', theme.pins[1])} slope 1, {_straight(test.fixed)} &nbsp; bars: 95 %"
        )
        self.plot.setXRange(float(at[0]), float(at[-1]), padding=0.06)
        reach = max(reach, 1e-4) * (1 + ROOM)
        self.plot.setYRange(-reach, reach, padding=0)

    def _line(self, y: float) -> None:
        pen = pg.mkPen(self._theme.muted, width=1, dash=[4, 4])
        self.plot.addItem(pg.InfiniteLine(y, angle=0, movable=False, pen=pen), ignoreBounds=True)

    # Sweep -----------------------------------------------------------------------------------------

    def _draw_sweep(self, points: Sequence[SweepPoint]) -> None:
        figure, theme, item = self._state.figure.value, self._theme, self.plot.getPlotItem()
        item.setLabel("left", f"{figure.words}{f' ({figure.unit})' if figure.unit else ''}")
        seen = {
            i: (math.log10(point.seconds), math.log10(error))
            for i, point in enumerate(points)
            if (error := point.error(figure)) and point.seconds > 0
        }
        if not seen:
            for side in ("bottom", "left"):
                item.getAxis(side).setTicks([[]])
            return
        best = [seen[i] for i in best_points(points, figure) if i in seen]
        pen = pg.mkPen(theme.accent, width=1.5)
        self.plot.addItem(pg.PlotCurveItem([x for x, _ in best], [y for _, y in best], pen=pen))
        ends = [self._draw_point(points[i], at, at in best) for i, at in seen.items()]
        self._set_ranges([x for x, _ in seen.values()], [y for pair in ends for y in pair])
        self.legend.setText(f"{_key('━', theme.accent)} no faster scan is better")

    def _draw_point(self, point: SweepPoint, at: tuple[float, float], is_best: bool) -> tuple[float, float]:
        """Draw a point with its name and bar; returns the ends of the bar."""
        theme, (x, y) = self._theme, at
        low = high = y
        figure = self._state.figure.value
        error, std = point.error(figure), point.std(figure)
        if error and std:
            share = BAND_95 * std / error
            low, high = y + math.log10(max(1 - share, 0.1)), y + math.log10(1 + share)
            bar: dict[str, Any] = {"x": np.array([x]), "y": np.array([y]), "pen": theme.muted}
            self.plot.addItem(
                pg.ErrorBarItem(**bar, top=np.array([high - y]), bottom=np.array([y - low]), beam=0.0)
            )
        colour = theme.accent if is_best else theme.muted
        self.plot.addItem(pg.ScatterPlotItem(x=[x], y=[y], size=9, brush=colour, pen=None))
        name = pg.TextItem(point.name, color=theme.text, anchor=(0.5, 1.3))
        name.setPos(x, y)
        self.plot.addItem(name, ignoreBounds=True)
        return low, high

    def _set_ranges(self, x: Sequence[float], y: Sequence[float]) -> None:
        item = self.plot.getPlotItem()
        for side, values, extra in (("bottom", x, 1.0), ("left", y, 2.0)):
            room = max(ROOM * (max(values) - min(values)), ROOM_DECADES)
            # Names stand above their points.
            low, high = min(values) - room, max(values) + extra * room
            (self.plot.setXRange if side == "bottom" else self.plot.setYRange)(low, high, padding=0)
            item.getAxis(side).setTicks([ticks(10**low, 10**high)])

    def apply_theme(self, theme: Theme) -> None:
        """Apply the colours of a theme."""
        self._theme = theme
        self.plot.apply_theme(theme)
        self.draw()


def _key(sign: str, colour: str) -> str:
    return f'<span style="color:{colour}">{sign}</span>'


def _straight(line: StageLine) -> str:
    rms, worst = (
        with_std_in_places(value, std, ".4f")
        for value, std in ((line.rms_mm, line.rms_std_mm), (line.worst_mm, line.worst_std_mm))
    )
    return f"RMS {rms} mm, worst {worst} mm"
