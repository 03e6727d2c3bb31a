"""Colours in front of lines of a list."""

from __future__ import annotations

import pytest
from dsl_app.shared.widgets.icons import SWATCH_PX, swatch
from PySide6.QtCore import QSize
from PySide6.QtGui import QColor, QIcon
from PySide6.QtWidgets import QApplication


@pytest.mark.parametrize("mode", [QIcon.Mode.Normal, QIcon.Mode.Selected])
def test_a_swatch_keeps_its_colour_on_a_selected_line(qapp: QApplication, mode: QIcon.Mode) -> None:
    colour = QColor("#0072b2")
    picture = swatch(colour.name()).pixmap(QSize(SWATCH_PX, SWATCH_PX), mode).toImage()
    assert picture.pixelColor(SWATCH_PX // 2, SWATCH_PX // 2) == colour
    # On a selection of nearly the same colour only its edge can be seen.
    edge = colour if mode is QIcon.Mode.Normal else QColor("white")
    assert picture.pixelColor(0, 0) == edge
