"""Charts of evidence: plots with a title and a legend, and what is drawn on them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from html import escape
from typing import Any

import numpy as np
import pyqtgraph as pg
from numpy.typing import NDArray
from PySide6.QtCore import Qt
from PySide6.QtGui import QColor, QShowEvent
from PySide6.QtWidgets import QStackedLayout, QWidget

from dsl_app.shared.spectrum import Spectrum
from dsl_app.shared.theme import DARK, Theme
from dsl_app.shared.widgets.deferred import call_deferred
from dsl_app.shared.widgets.forms import label
from dsl_app.shared.widgets.inside import apply_theme_inside
from dsl_app.shared.widgets.layouts import column_of
from dsl_app.shared.widgets.plots import RGB_COLOURS, CalmPlot
from dsl_app.shared.widgets.spectrum_curve import SpectrumCurve
from dsl_core.model.spectral import SpectralCurve
from dsl_core.solve.normal import BAND_95

Floats = NDArray[np.floating[Any]]
#: A name of the legend with its colour (``#rrggbb``) and the sign that stands for it.
Key = tuple[str, str, str]
LINE, DASHES, DOT, BAR = "━", "┅", "●", "■"
#: Channels of the camera and LEDs of the projector, in order.
CHANNELS = ("red", "green", "blue")


class ChartBox(QWidget):
    """A plot under its title and legend; a sentence instead while there is nothing to draw.

    Plots are slow to make: this one is made and drawn when it is first seen.
    """

    def __init__(
        self,
        title: str,
        tip: str,
        left: str,
        bottom: str,
        left_width: int = 52,
        prepare: Callable[[Any], object] = lambda plot: None,
    ) -> None:
        """``prepare`` gets the plot when it is made."""
        super().__init__()
        self._theme, self._prepare = DARK, prepare
        self._make = partial(CalmPlot, title, tip, left, bottom, left_width)
        self._plot: Any = None
        self._draw: Callable[[], object] | None = None
        self._is_next = False
        self.title = label(title, "heading")
        self.legend = label("", wraps=True)
        self.legend.setTextFormat(Qt.TextFormat.RichText)
        self.legend.setAccessibleName(f"Legend of {title}")
        self.sentence = label("", "muted", wraps=True)
        self.sentence.setAlignment(Qt.AlignmentFlag.AlignTop)
        self._stack = QStackedLayout()
        self._stack.addWidget(self.sentence)
        column_of(self.title, self.legend, (self._stack, 1), on=self, margins=0, spacing=2)

    def hasHeightForWidth(self) -> bool:
        """Boxes next to and below each other share the room equally, however long their legends are."""
        return False

    @property
    def plot(self) -> Any:
        """The plot with everything drawn on it."""
        self._make_plot()
        self._draw_now()
        return self._plot

    def _make_plot(self) -> None:
        if self._plot is None:
            self._plot = self._make()
            self._plot.setMouseEnabled(False, False)
            self._plot.setMinimumHeight(90)
            self._plot.apply_theme(self._theme)
            self._stack.addWidget(self._plot)
            self._prepare(self._plot)

    @property
    def item(self) -> Any:
        """What curves are added to."""
        return self.plot.getPlotItem()

    def draw(self, draw: Callable[[], object]) -> None:
        """Call ``draw`` as soon as the box is visible; only the latest one is called."""
        self._draw = draw
        if self.isVisible():
            self._draw_soon()

    def showEvent(self, event: QShowEvent) -> None:
        """Draw what waited for it, one box after another."""
        super().showEvent(event)
        self._draw_soon()

    def _draw_soon(self) -> None:
        if self._draw is not None and not self._is_next:
            self._is_next = True
            call_deferred(self, self._take_turn)

    def _take_turn(self) -> None:
        self._is_next = False
        if not self.isVisible():
            return
        # Making a plot takes as long as drawing on it: a turn each.
        if self._plot is None and self._draw is not None:
            self._make_plot()
            self._draw_soon()
        else:
            self._draw_now()

    def _draw_now(self) -> None:
        draw, self._draw = self._draw, None
        if draw is not None:
            draw()

    def begin(self) -> None:
        """Clear the plot and show it."""
        self.item.clear()
        self.legend.clear()
        self.legend.hide()
        self._stack.setCurrentWidget(self.plot)

    def say(self, sentence: str) -> None:
        """Show a sentence instead of the plot; what waited to be drawn is dropped."""
        self._draw = None
        if self._plot is not None:
            self._plot.getPlotItem().clear()
        self.legend.clear()
        self.legend.hide()
        self.sentence.setText(sentence)
        self._stack.setCurrentWidget(self.sentence)

    def name_curves(self, *keys: Key) -> None:
        """Show a legend of colours and names."""
        self.legend.setText(" &nbsp; ".join(_legend(*key) for key in keys))
        self.legend.show()

    def apply_theme(self, theme: Theme) -> None:
        """Take the colours of a theme; what is drawn keeps its own."""
        self._theme = theme
        apply_theme_inside(self, theme)


def like_a_picture(plot: Any) -> None:
    """Square pixels, and rows that count downwards."""
    plot.getViewBox().setAspectLocked(True)
    plot.getViewBox().invertY(True)


def _legend(name: str, colour: str, sign: str) -> str:
    words = escape(name).replace(" ", "&nbsp;")
    return f'<span style="color:{colour}">{sign}</span>&nbsp;{words}' if sign else words


@dataclass(frozen=True)
class NamedCurve:
    """A curve with its name and colour; ``dashed`` for what it is compared with."""

    name: str
    colour: str
    curve: SpectralCurve
    dashed: bool = False


def channel_curves(curves: Sequence[SpectralCurve]) -> list[NamedCurve]:
    """Curves of red, green and blue in their colours."""
    return [NamedCurve(*each) for each in zip(CHANNELS, RGB_COLOURS, curves, strict=True)]


def draw_curves(box: ChartBox, curves: Sequence[NamedCurve]) -> list[SpectrumCurve]:
    """Draw curves with 95 % bands over all their wavelengths, and name them."""
    drawn = []
    for each in curves:
        std = None if each.curve.std is None else np.array(each.curve.std)
        made = SpectrumCurve(box.item, with_band=std is not None)
        made.set_colour(each.colour, dashed=each.dashed)
        made.set_spectrum(Spectrum(np.array(each.curve.wavelengths_nm), np.array(each.curve.values), std))
        drawn.append(made)
    low = min(each.curve.wavelengths_nm[0] for each in curves)
    high = max(each.curve.wavelengths_nm[-1] for each in curves)
    top = max(max(each.curve.values) for each in curves)
    box.item.setXRange(low, high, padding=0.01)
    box.item.setYRange(min(0.0, min(min(each.curve.values) for each in curves)), 1.08 * top, padding=0)
    box.name_curves(*((each.name, each.colour, DASHES if each.dashed else LINE) for each in curves))
    return drawn


def draw_points(
    box: ChartBox, x: Floats, y: Floats, std: Floats | None, colour: str, symbol: str = "o", size: int = 7
) -> Any:
    """Points with error bars of 95 % in a colour; returns the points. Those that are NaN are not drawn."""
    known = np.isfinite(np.asarray(y))
    x, y, std = np.asarray(x)[known], np.asarray(y)[known], None if std is None else np.asarray(std)[known]
    if std is not None:
        half = BAND_95 * std
        bars = pg.ErrorBarItem(x=x, y=y, height=2 * half, beam=0.0, pen=colour)
        box.item.addItem(bars)
    points = pg.ScatterPlotItem(x=x, y=y, size=size, symbol=symbol, brush=colour, pen=None)
    box.item.addItem(points)
    return points


def level_line(box: ChartBox, value: float, colour: str, name: str = "") -> Any:
    """A dashed line across the plot, such as a limit."""
    options = {"color": colour, "position": 0.98, "anchors": [(1, 1), (1, 1)]}
    line = pg.InfiniteLine(
        value,
        angle=0,
        movable=False,
        pen=pg.mkPen(colour, width=1, dash=[4, 4]),
        label=name or None,
        labelOpts=options,
    )
    box.item.addItem(line, ignoreBounds=True)
    return line


@dataclass(frozen=True)
class Bars:
    """One bar a group: their name, colour and heights; ``is_pale`` fades single bars."""

    name: str
    colour: str
    heights: Floats
    is_pale: Sequence[bool] = ()


def draw_bars(
    box: ChartBox, kinds: Sequence[Bars], names: Sequence[str], limit: float, theme: Theme, *others: Key
) -> None:
    """Draw groups of bars on a fresh plot, names below, against a limit; ``others`` join the legend."""
    box.begin()
    at, width = np.arange(len(names)), 0.8 / len(kinds)
    for index, kind in enumerate(kinds):
        pale = kind.is_pale or (False,) * len(names)
        brushes = [_brush(kind.colour, 70 if each else 255) for each in pale]
        place = at + width * (index - (len(kinds) - 1) / 2)
        box.item.addItem(
            pg.BarGraphItem(
                x=place, height=kind.heights, width=0.9 * width, brushes=brushes, pen=pg.mkPen(None)
            )
        )
    box.item.getAxis("bottom").setTicks([list(enumerate(names))])
    box.item.setXRange(-0.6, len(names) - 0.4, padding=0)
    range_from_zero(box, max(float(np.max(kind.heights)) for kind in kinds), limit, theme)
    box.name_curves(*((kind.name, kind.colour, BAR) for kind in kinds if kind.name), *others)


def _brush(colour: str, alpha: int) -> QColor:
    made = QColor(colour)
    made.setAlpha(alpha)
    return made


def range_from_zero(box: ChartBox, top: float, limit: float, theme: Theme) -> None:
    """Show values from zero to the largest, and their limit where it is near."""
    if top > limit / 2:
        level_line(box, limit, theme.bad, "limit")
        top = max(top, 1.1 * limit)
    box.item.setYRange(0, 1.1 * top, padding=0)


def range_about_zero(box: ChartBox, reach: float, limit: float, theme: Theme) -> None:
    """Show values on both sides of zero, and their limits where they are near."""
    level_line(box, 0.0, theme.muted)
    if reach > limit / 2:
        level_line(box, limit, theme.bad, "limit")
        level_line(box, -limit, theme.bad)
        reach = max(reach, 1.2 * limit)
    box.item.setYRange(-reach, reach, padding=0)
