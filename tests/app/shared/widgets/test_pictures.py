from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from dsl_app.shared.widgets.forms import ChoiceBox, NumberBox, WholeBox
from dsl_app.shared.widgets.pictures import (
    DIFFERENCE,
    Canvas,
    PictureView,
    arrow_step,
    colour_map,
    moved_within,
)
from dsl_app.shared.widgets.plots import CalmPlot
from PySide6.QtCore import QEvent, QPoint, QPointF, Qt
from PySide6.QtGui import QDragLeaveEvent, QKeyEvent, QWheelEvent
from PySide6.QtWidgets import QApplication, QWidget
from pytestqt.qtbot import QtBot


def _key(key: Qt.Key, modifier: Qt.KeyboardModifier = Qt.KeyboardModifier.NoModifier) -> QKeyEvent:
    return QKeyEvent(QEvent.Type.KeyPress, key, modifier)


def test_a_difference_of_zero_is_white_and_both_signs_darken_evenly() -> None:
    table = colour_map(DIFFERENCE).getLookupTable(nPts=257).astype(int)
    assert table[128].tolist() == [245, 245, 245]
    # Close to zero no tint is seen yet; at the ends blue is negative, red positive.
    assert np.ptp(table[127:130], axis=1).max() <= 3
    assert table[0, 2] > table[0, 0]
    assert table[-1, 0] > table[-1, 2]
    light = table @ [0.2126, 0.7152, 0.0722]
    assert (np.diff(light[:129]) > -0.5).all()
    assert (np.diff(light[128:]) < 0.5).all()


def test_arrows_step_and_shift_steps_further() -> None:
    assert arrow_step(_key(Qt.Key.Key_Up)) == (0, -1)
    assert arrow_step(_key(Qt.Key.Key_Right, Qt.KeyboardModifier.ShiftModifier)) == (10, 0)
    assert arrow_step(_key(Qt.Key.Key_A)) is None


def test_steps_end_at_the_edge() -> None:
    assert moved_within((0, 5), (-1, 10), (8, 6)) == (0, 5)
    assert moved_within((3, 2), (1, -1), (8, 6)) == (4, 1)


def _boxes() -> list[NumberBox | WholeBox | ChoiceBox]:
    choice = ChoiceBox("Choice")
    choice.addItems(["a", "b", "c"])
    choice.setCurrentIndex(1)
    return [NumberBox("Number", 0, 10, 5), WholeBox("Whole", 0, 10, 5), choice]


def _wheel(widget: QWidget) -> None:
    at = QPointF(4, 4)
    event = QWheelEvent(
        at, at, QPoint(0, 0), QPoint(0, -120), Qt.MouseButton.NoButton, Qt.KeyboardModifier.NoModifier,
        Qt.ScrollPhase.NoScrollPhase, False,
    )  # fmt: skip
    widget.wheelEvent(event)


@pytest.mark.parametrize("i", range(3))
def test_the_wheel_changes_only_what_has_the_focus(qtbot: QtBot, i: int) -> None:
    box = _boxes()[i]
    qtbot.addWidget(box)
    box.show()
    value = (lambda: box.currentIndex()) if isinstance(box, ChoiceBox) else box.value
    before = value()
    _wheel(box)
    assert value() == before
    box.setFocus()
    qtbot.waitUntil(box.hasFocus)
    _wheel(box)
    assert value() != before


def test_what_is_dragged_over_a_plot_leaves_no_warning(qtbot: QtBot, qtlog: Any) -> None:
    for made in (Canvas("Picture"), CalmPlot("Plot", "", "Left", "Bottom")):
        qtbot.addWidget(made)
        QApplication.sendEvent(made.viewport(), QDragLeaveEvent())
    assert [each.message for each in qtlog.records] == []


def test_a_cleared_picture_is_gone_from_the_screen(qtbot: QtBot, monkeypatch: pytest.MonkeyPatch) -> None:
    view, painted = PictureView("Picture"), list[str]()
    qtbot.addWidget(view)
    view.image.setImage(np.full((20, 30, 3), 200, np.uint8), autoLevels=False, levels=None)
    monkeypatch.setattr(view.viewport(), "update", lambda: painted.append("all of it"))
    view.image.clear()
    assert painted == ["all of it"]
