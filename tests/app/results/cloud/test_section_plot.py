"""The curve of a section gives way where there is little room, and keeps its unit."""

from __future__ import annotations

import pytest
from dsl_app.results.cloud.section_plot import HEIGHT_PX, LEAST_PX, SectionPlot
from dsl_app.shared.widgets.layouts import column_of
from PySide6.QtWidgets import QWidget
from pytestqt.qtbot import QtBot

VIEW_PX = 80


@pytest.mark.parametrize(
    ("room_px", "height_px", "said"), [(400, HEIGHT_PX, "Height (mm)"), (180, LEAST_PX, "mm")]
)
def test_it_leaves_room_for_what_is_cut(qtbot: QtBot, room_px: int, height_px: int, said: str) -> None:
    plot, view, page = SectionPlot(), QWidget(), QWidget()
    view.setMinimumHeight(VIEW_PX)
    column_of((view, 1), plot, on=page, margins=0, spacing=0)
    qtbot.addWidget(page)
    page.resize(300, room_px)
    page.show()
    qtbot.waitExposed(page)
    assert view.height() >= VIEW_PX
    assert height_px <= plot.height() < height_px + 15
    assert plot.getPlotItem().getAxis("left").labelText == said
