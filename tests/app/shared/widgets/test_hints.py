"""Hints of plots and pictures stand in the status line, not over the data."""

from __future__ import annotations

import pytest
from dsl_app.shared.widgets.hints import FocusRing
from dsl_app.shared.widgets.pictures import PictureView
from dsl_app.shared.widgets.plots import CalmPlot
from PySide6.QtCore import QEvent, QPoint, Qt
from PySide6.QtGui import QEnterEvent, QFocusEvent, QHelpEvent
from PySide6.QtWidgets import QApplication, QDialog, QMainWindow, QToolTip, QVBoxLayout, QWidget
from pytestqt.qtbot import QtBot

HINT = "Drag to pan, wheel to zoom."


def _made(kind: str) -> QWidget:
    return PictureView("Picture", HINT) if kind == "picture" else CalmPlot("Plot", HINT, "y", "x")


def _point_at(widget: QWidget) -> None:
    middle = widget.rect().center()
    place = widget.mapToGlobal(middle)
    QApplication.sendEvent(widget, QEnterEvent(middle.toPointF(), middle.toPointF(), place.toPointF()))
    QApplication.sendEvent(widget, QHelpEvent(QEvent.Type.ToolTip, middle, place))


@pytest.fixture(autouse=True)
def no_tip_of_another_test(qapp: QApplication) -> None:
    QToolTip.showText(QPoint(0, 0), "")


@pytest.mark.parametrize("kind", ["picture", "plot"])
def test_the_status_line_has_the_hint(qtbot: QtBot, kind: str) -> None:
    window, widget = QMainWindow(), _made(kind)
    window.setCentralWidget(widget)
    qtbot.addWidget(window)
    window.show()
    line = window.statusBar()
    _point_at(widget)
    assert line.currentMessage() == HINT
    assert QToolTip.text() == ""
    assert widget.accessibleName()


def _focus(widget: QWidget, kind: QEvent.Type, reason: Qt.FocusReason) -> None:
    QApplication.sendEvent(widget, QFocusEvent(kind, reason))


@pytest.mark.parametrize("kind", ["picture", "plot"])
def test_a_frame_shows_what_the_tab_key_came_to(qtbot: QtBot, kind: str) -> None:
    widget = _made(kind)
    qtbot.addWidget(widget)
    widget.resize(200, 100)
    widget.show()
    ring = widget.findChild(FocusRing)
    assert ring is not None
    came, went = QEvent.Type.FocusIn, QEvent.Type.FocusOut
    _focus(widget, came, Qt.FocusReason.MouseFocusReason)
    assert not ring.isVisible(), "the mouse shows by itself where it is"
    _focus(widget, came, Qt.FocusReason.TabFocusReason)
    assert ring.isVisible()
    widget.resize(240, 120)
    assert ring.size() == widget.size()
    colour = ring.grab().toImage().pixelColor(0, 60)
    assert colour == ring.palette().highlight().color()
    _focus(widget, went, Qt.FocusReason.ActiveWindowFocusReason)
    assert ring.isVisible(), "the keys come back to it with its window"
    _focus(widget, went, Qt.FocusReason.TabFocusReason)
    assert not ring.isVisible()


def test_the_frame_lies_on_the_part_that_is_seen(qtbot: QtBot) -> None:
    owner = QWidget()
    qtbot.addWidget(owner)
    part = QWidget(owner)
    part.setGeometry(10, 10, 50, 40)
    ring = FocusRing(owner, part)
    owner.show()
    _focus(owner, QEvent.Type.FocusIn, Qt.FocusReason.BacktabFocusReason)
    assert ring.parentWidget() is part
    assert ring.isVisible()
    assert ring.size() == part.size()


@pytest.mark.parametrize("kind", ["picture", "plot"])
def test_a_dialog_shows_it_as_a_tooltip(qtbot: QtBot, kind: str) -> None:
    dialog, widget = QDialog(), _made(kind)
    QVBoxLayout(dialog).addWidget(widget)
    qtbot.addWidget(dialog)
    dialog.show()
    _point_at(widget)
    assert QToolTip.text() == HINT
    QToolTip.hideText()
