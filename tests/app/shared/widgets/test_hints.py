"""Hints of plots and pictures stand in the status line, not over the data."""

from __future__ import annotations

import pytest
from dsl_app.shared.widgets.pictures import PictureView
from dsl_app.shared.widgets.plots import CalmPlot
from PySide6.QtCore import QEvent, QPoint
from PySide6.QtGui import QEnterEvent, QHelpEvent
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


@pytest.mark.parametrize("kind", ["picture", "plot"])
def test_a_dialog_shows_it_as_a_tooltip(qtbot: QtBot, kind: str) -> None:
    dialog, widget = QDialog(), _made(kind)
    QVBoxLayout(dialog).addWidget(widget)
    qtbot.addWidget(dialog)
    dialog.show()
    _point_at(widget)
    assert QToolTip.text() == HINT
    QToolTip.hideText()
