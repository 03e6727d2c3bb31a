"""The intensity graph of a scan that runs."""

from __future__ import annotations

import numpy as np
import pytest
from dsl_app.scan.view import CHANNEL_COLOURS, FramePicture, GraphPlot
from dsl_app.shared.widgets.plots import MONO_COLOUR
from pytestqt.qtbot import QtBot

from dsl_core.capture.preview import BlockGraph


def test_a_monochrome_camera_has_one_grey_curve_for_each_setting(qtbot: QtBot) -> None:
    plot = GraphPlot()
    qtbot.addWidget(plot)

    def shown(channels: int) -> list[str]:
        counts = np.full((2, 4, channels), 7.0, np.float32)
        plot.show_graph(BlockGraph((3, 4), 2, np.arange(4.0), counts))
        return [curve.opts["pen"].color().name() for curve in plot._curves if curve.isVisible()]

    for _ in range(2):
        assert shown(3) == [*CHANNEL_COLOURS, *CHANNEL_COLOURS]
        assert shown(1) == [MONO_COLOUR, MONO_COLOUR]


@pytest.mark.parametrize(
    ("low_mm", "high_mm", "says"),
    [
        (400.0, 1000.0, "403 mm (dark) to 997 mm (bright)"),
        (700.0, 700.4, "700.00 mm (dark) to 700.40 mm (bright)"),
        (700.0, 700.0, "699.65 mm (dark) to 700.35 mm (bright)"),
    ],
)
def test_the_ends_of_a_depth_are_told_apart(qtbot: QtBot, low_mm: float, high_mm: float, says: str) -> None:
    picture = FramePicture()
    qtbot.addWidget(picture)
    picture.show_depth(np.linspace(low_mm, high_mm, 2000, dtype=np.float32).reshape(40, 50))
    assert says in picture._text.text()


def test_the_title_of_the_graph_is_all_there_where_it_is_narrow(qtbot: QtBot) -> None:
    plot = GraphPlot()
    qtbot.addWidget(plot)
    title = plot._title
    width_px = title.fontMetrics().horizontalAdvance(title.text()) * 3 // 4
    plot.resize(width_px, 300)
    plot.show()
    graph = BlockGraph((3214, 1420), 2, np.arange(4.0), np.full((1, 4, 3), 7.0, np.float32))
    for shown in (None, graph):
        plot.show_graph(shown)
        qtbot.waitUntil(lambda: title.height() >= title.heightForWidth(title.width()))
        assert plot.width() == width_px
