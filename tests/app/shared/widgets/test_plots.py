"""What all plots have in common."""

from __future__ import annotations

import pyqtgraph as pg
from dsl_app.shared.theme import DARK, LIGHT
from dsl_app.shared.widgets.plots import CalmPlot, theme_bar
from pytestqt.qtbot import QtBot


def test_negative_numbers_have_a_minus_at_plots_and_colour_bars(qtbot: QtBot) -> None:
    plot, bar = CalmPlot("Difference", "", "mm", "nm"), pg.ColorBarItem(interactive=False)
    qtbot.addWidget(plot)
    for theme in (DARK, LIGHT):
        theme_bar(bar, theme)
    for axis in (plot.getPlotItem().getAxis("left"), bar.getAxis("right")):
        assert axis.tickStrings([-0.2, 0.0, 0.2], 1.0, 0.2) == ["−0.2", "0", "0.2"]
