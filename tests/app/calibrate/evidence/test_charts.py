"""Charts are drawn when they are seen, one after another, with their limits."""

from __future__ import annotations

import time

import numpy as np
import pyqtgraph as pg
import pytest
from dsl_app.calibrate.evidence.charts import (
    Bars,
    ChartBox,
    channel_curves,
    draw_bars,
    draw_curves,
    range_about_zero,
    range_from_zero,
)
from dsl_app.shared.theme import LIGHT
from dsl_app.shared.widgets.deferred import PAUSE_MS
from PySide6.QtCore import QTimer
from PySide6.QtWidgets import QHBoxLayout, QWidget
from pytestqt.qtbot import QtBot

from tests.app.calibrate.evidence_bench import bump, items


def test_between_two_charts_the_window_comes_round(qtbot: QtBot) -> None:
    page = QWidget()
    qtbot.addWidget(page)
    row, rounds, drawn = QHBoxLayout(page), list[None](), list[int]()
    clock = QTimer(page)
    clock.timeout.connect(lambda: rounds.append(None))
    clock.start(0)

    def draw() -> None:
        drawn.append(len(rounds))
        time.sleep(2.5e-3 * PAUSE_MS)

    boxes = [ChartBox(f"Chart {i}", "A chart", "y", "x") for i in range(3)]
    for box in boxes:
        row.addWidget(box)
        box.draw(draw)
    page.show()
    qtbot.waitUntil(lambda: len(drawn) == 3)
    assert len(set(drawn)) == 3
    boxes[1].hide()
    for box in boxes:
        box.draw(draw)
    qtbot.waitUntil(lambda: len(drawn) == 5)
    boxes[1].show()
    qtbot.waitUntil(lambda: len(drawn) == 6)


def test_what_nobody_sees_is_not_drawn(qtbot: QtBot) -> None:
    box, drawn = ChartBox("A chart", "Tip", "Left", "Bottom"), list[str]()
    qtbot.addWidget(box)
    box.draw(lambda: drawn.append("first"))
    box.draw(lambda: drawn.append("latest"))
    assert drawn == []
    box.show()
    qtbot.waitUntil(lambda: drawn == ["latest"])
    box.draw(lambda: drawn.append("while it is seen"))
    qtbot.waitUntil(lambda: drawn[1:] == ["while it is seen"])
    box.draw(lambda: drawn.append("never"))
    box.say("There is nothing to draw.")
    assert box.plot is not None
    assert "never" not in drawn


def limits(box: ChartBox) -> list[float]:
    return sorted(float(line.value()) for line in items(box, pg.InfiniteLine))


def top(box: ChartBox) -> float:
    return float(box.item.getViewBox().viewRange()[1][1])


def test_groups_of_bars_stand_next_to_each_other_over_their_names(qtbot: QtBot) -> None:
    box = ChartBox("A chart", "Tip", "Left", "Bottom")
    qtbot.addWidget(box)
    faded = Bars("a", "#ff0000", np.array([1.0, 2.0]), (False, True))
    kinds = [faded, Bars("b", "#00ff00", np.array([3.0, 0.0]))]
    draw_bars(box, kinds, ["first", "second"], 2.0, LIGHT, ("c", "#0000ff", "●"))
    assert top(box) == pytest.approx(3.3)
    assert limits(box) == [2.0]
    red, green = items(box, pg.BarGraphItem)
    assert np.allclose(red.opts["x"], (-0.2, 0.8))
    assert np.allclose(green.opts["x"], (0.2, 1.2))
    assert [brush.alpha() for brush in red.opts["brushes"]] == [255, 70]
    assert [brush.name() for brush in green.opts["brushes"]] == ["#00ff00", "#00ff00"]
    assert box.item.getAxis("bottom")._tickLevels == [[(0, "first"), (1, "second")]]
    assert all(f"&nbsp;{name}" in box.legend.text() for name in "abc"), "bars and others are named"


def test_a_limit_is_drawn_where_it_is_near(qtbot: QtBot) -> None:
    box = ChartBox("A chart", "Tip", "Left", "Bottom")
    qtbot.addWidget(box)
    range_from_zero(box, 0.2, 0.5, LIGHT)
    assert limits(box) == []
    assert top(box) == pytest.approx(0.22)
    range_from_zero(box, 0.3, 0.5, LIGHT)
    assert limits(box) == [0.5]
    assert top(box) == pytest.approx(1.1 * 0.55), "the limit is inside the plot"
    range_from_zero(box, 0.9, 0.5, LIGHT)
    assert top(box) == pytest.approx(0.99)


def test_limits_on_both_sides_of_zero(qtbot: QtBot) -> None:
    box = ChartBox("A chart", "Tip", "Left", "Bottom")
    qtbot.addWidget(box)
    range_about_zero(box, 0.2, 0.5, LIGHT)
    assert limits(box) == [0.0]
    assert top(box) == pytest.approx(0.2)
    box.begin()
    range_about_zero(box, 0.3, 0.5, LIGHT)
    assert limits(box) == [-0.5, 0.0, 0.5]
    assert top(box) == pytest.approx(0.6)


def test_curves_of_the_channels_have_their_colours(qtbot: QtBot) -> None:
    box = ChartBox("A chart", "Tip", "Left", "Bottom")
    qtbot.addWidget(box)
    named = channel_curves([bump(630, 10), bump(540, 30), bump(460, 12, std=None)])
    assert [each.name for each in named] == ["red", "green", "blue"]
    drawn = draw_curves(box, named)
    assert [each.band is not None for each in drawn] == [True, True, False]
    assert box.legend.text().count("━") == 3
    assert box.item.getViewBox().viewRange()[0] == pytest.approx([397, 703], abs=1)
