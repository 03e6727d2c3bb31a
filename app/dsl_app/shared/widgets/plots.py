"""Plots that look alike: calm axes, a faint grid, colours of the theme."""

from __future__ import annotations

import math
from typing import Any

import pyqtgraph as pg
from PySide6.QtCore import QEvent
from PySide6.QtGui import QDragLeaveEvent
from PySide6.QtWidgets import QGraphicsItem

from dsl_app.shared.theme import Theme
from dsl_app.shared.widgets.hints import hint, is_said_below

Ticks = list[tuple[float, str]]
#: Seconds that are marked, as far as they are in view.
TIMES_S = (5, 10, 20, 30, 60, 120, 300, 600, 1200, 3600)
#: Ranges narrower than this factor are marked evenly, wider ones at 1, 2 and 5.
NARROW = 8.0
#: Red, green and blue that are told apart on both themes.
RGB_COLOURS = ("#e0524d", "#2fa84f", "#4c8dff")
#: That of a monochrome camera, on either theme.
MONO_COLOUR = "#8a8f98"


class CalmPlot(pg.PlotWidget):  # type: ignore[misc]
    """A plot without menus and buttons that keeps its axes in place."""

    def __init__(self, name: str, tip: str, left: str, bottom: str, left_width: int = 52) -> None:
        super().__init__(enableMenu=False)
        hint(self, name, tip)
        item = self.getPlotItem()
        item.hideButtons()
        item.showGrid(x=True, y=True, alpha=0.18)
        for side, text in (("left", left), ("bottom", bottom)):
            item.setLabel(side, text)
            item.getAxis(side).enableAutoSIPrefix(False)
            write_minus(item.getAxis(side))
            # Drawn once, and not again with every curve that moves over their grid.
            item.getAxis(side).setCacheMode(QGraphicsItem.CacheMode.DeviceCoordinateCache)
        item.getAxis("left").setWidth(left_width)

    def event(self, event: QEvent) -> bool:
        """Leave out a tooltip that the status line has already."""
        return False if is_said_below(self, event) else bool(super().event(event))

    def dragLeaveEvent(self, event: QDragLeaveEvent) -> None:
        """What is dragged never entered: pyqtgraph leaves it to the window. Qt would warn of that."""

    def apply_theme(self, theme: Theme) -> None:
        """Apply the colours of a theme to background and axes."""
        self.setBackground(theme.base)
        for side in ("left", "bottom"):
            axis = self.getPlotItem().getAxis(side)
            axis.setPen(theme.line)
            axis.setTextPen(theme.muted)
            axis.labelStyle["color"] = theme.muted
            axis.setLabel(axis.labelText)


def colour_legend(legend: Any, colour: str) -> None:
    """Give the texts of a legend of pyqtgraph a colour, also those that are there already."""
    legend.setLabelTextColor(colour)
    for _, text in legend.items:
        text.setText(text.text, color=colour)


def write_minus(axis: Any) -> None:
    """Let an axis of pyqtgraph write a minus before negative numbers, as tables do, and not a hyphen."""
    if "tickStrings" in vars(axis):
        return
    plain = axis.tickStrings

    def strings(values: list[float], scale: float, spacing: float) -> list[str]:
        return [text.replace("-", "−") for text in plain(values, scale, spacing)]

    axis.tickStrings = strings


def theme_bar(bar: Any, theme: Theme) -> None:
    """Apply the colours of a theme to a colour bar of pyqtgraph."""
    for side in ("left", "right"):
        axis = bar.getAxis(side)
        write_minus(axis)
        axis.setTextPen(theme.text)
        axis.setPen(theme.line)
        axis.labelStyle["color"] = theme.text


def time_ticks(low_s: float, high_s: float) -> Ticks:
    """Where seconds and minutes are marked.

    >>> [text for _, text in time_ticks(12, 150)]
    ['20 s', '30 s', '1 min', '2 min']
    """
    return [(math.log10(s), _time(s)) for s in TIMES_S if low_s <= s <= high_s]


def _time(seconds: int) -> str:
    return f"{seconds} s" if seconds < 60 else f"{seconds // 60} min"


def ticks(low: float, high: float) -> Ticks:
    """Where values are marked.

    >>> [text for _, text in ticks(0.004, 0.05)]
    ['0.005', '0.01', '0.02', '0.05']
    >>> [text for _, text in ticks(9.0, 18.0)]
    ['10', '12', '14', '16', '18']
    """
    return [(math.log10(value), f"{value:.6g}") for value in _values(low, high)]


def _values(low: float, high: float) -> list[float]:
    if high / low < NARROW:
        step = _step((high - low) / 5)
        first = math.ceil(low / step - 1e-9)
        return [i * step for i in range(first, math.floor(high / step + 1e-9) + 1)]
    decades = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    found = [digit * 10.0**decade for decade in decades for digit in (1, 2, 5)]
    return [value for value in found if low * (1 - 1e-9) <= value <= high * (1 + 1e-9)]


def _step(rough: float) -> float:
    """The next 1, 2 or 5 above."""
    unit = 10.0 ** math.floor(math.log10(rough))
    return next(digit * unit for digit in (1, 2, 5, 10) if digit * unit >= rough * (1 - 1e-9))
