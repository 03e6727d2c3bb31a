"""Plots that look alike: calm axes, a faint grid, colours of the theme."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import pyqtgraph as pg

from dsl_app.shared.theme import Theme

#: Red, green and blue that are told apart on both themes.
RGB_COLOURS = ("#e0524d", "#2fa84f", "#4c8dff")


def calm_plot(name: str, tip: str, left: str, bottom: str, left_width: int = 52) -> Any:
    """A plot widget without menus and buttons that keeps its axes in place."""
    plot = pg.PlotWidget(enableMenu=False)
    plot.setAccessibleName(name)
    plot.setToolTip(tip)
    item = plot.getPlotItem()
    item.hideButtons()
    item.showGrid(x=True, y=True, alpha=0.18)
    for side, text in (("left", left), ("bottom", bottom)):
        item.setLabel(side, text)
        item.getAxis(side).enableAutoSIPrefix(False)
    item.getAxis("left").setWidth(left_width)
    return plot


def theme_plots(plots: Iterable[Any], theme: Theme) -> None:
    """Give plots the colours of a theme."""
    for plot in plots:
        plot.setBackground(theme.base)
        for side in ("left", "bottom"):
            axis = plot.getPlotItem().getAxis(side)
            axis.setPen(theme.line)
            axis.setTextPen(theme.muted)
            axis.labelStyle["color"] = theme.muted
            axis.setLabel(axis.labelText)
