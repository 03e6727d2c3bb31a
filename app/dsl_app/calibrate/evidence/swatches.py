"""The 24 patches as split squares: left as measured, right as expected, with what is left over."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QEvent, QRectF, Qt
from PySide6.QtGui import QColor, QFontMetricsF, QHelpEvent, QPainter, QPaintEvent, QPen
from PySide6.QtWidgets import QToolTip, QWidget

from dsl_app.shared.theme import DARK, Theme

ROWS, COLUMNS, GAP = 4, 6, 4.0
Floats = NDArray[np.float64]


def screen_colours(share: Floats) -> list[QColor]:
    """Colours for the screen from channel signals over white, (n, 3); the camera's red, green and blue."""
    encoded = np.clip(share, 0, 1) ** (1 / 2.2)
    return [QColor.fromRgbF(*map(float, row)) for row in encoded]


class Swatches(QWidget):
    """Four rows of six, in reading order; the number below each is its held-out residual, % of white."""

    def __init__(self) -> None:
        super().__init__()
        self._theme = DARK
        self.measured: list[QColor] = []
        self.expected: list[QColor] = []
        self._names: list[str] = []
        self._held_out: list[float] = []
        self._sentence = "Reading the picture…"
        self.setMinimumSize(220, 150)
        self.setAccessibleName("Patches as measured and as expected")

    def show_colours(
        self, measured: Floats, expected: Floats, held_out: Sequence[float], names: Sequence[str]
    ) -> None:
        """Show signals over white, (24, 3), and residuals as a share of white."""
        self.measured, self.expected = screen_colours(measured), screen_colours(expected)
        self._held_out, self._names = list(held_out), list(names)
        worst = int(np.argmax(held_out))
        self.setAccessibleDescription(
            f"Farthest from expectation is {names[worst]}, by {100 * held_out[worst]:.1f} % of white."
        )
        self.update()

    def clear(self, sentence: str) -> None:
        """Show a sentence in place of patches."""
        self.measured, self.expected, self._names, self._held_out = [], [], [], []
        self._sentence = sentence
        self.setAccessibleDescription(sentence)
        self.update()

    def apply_theme(self, theme: Theme) -> None:
        """Take the colours of a theme."""
        self._theme = theme
        self.update()

    def _place(self, index: int) -> QRectF:
        """Where a patch stands, with room for its number."""
        width, height = self.width() / COLUMNS, self.height() / ROWS
        return QRectF(index % COLUMNS * width, index // COLUMNS * height, width - GAP, height - GAP)

    def paintEvent(self, event: QPaintEvent) -> None:
        """Draw all patches."""
        painter = QPainter(self)
        line = QFontMetricsF(self.font()).height()
        if not self.measured:
            painter.setPen(QColor(self._theme.muted))
            painter.drawText(self.rect(), Qt.AlignmentFlag.AlignTop, self._sentence)
            return
        for index, (measured, expected) in enumerate(zip(self.measured, self.expected, strict=True)):
            place = self._place(index)
            square = place.adjusted(0, 0, 0, -line)
            middle = square.center().x()
            painter.fillRect(
                QRectF(square.left(), square.top(), middle - square.left(), square.height()), measured
            )
            painter.fillRect(QRectF(middle, square.top(), square.right() - middle, square.height()), expected)
            painter.setPen(QPen(QColor(self._theme.line), 1))
            painter.drawRect(square)
            painter.setPen(QColor(self._theme.muted))
            below = QRectF(place.left(), square.bottom(), place.width(), line)
            painter.drawText(below, Qt.AlignmentFlag.AlignHCenter, f"{100 * self._held_out[index]:.2f}")

    def event(self, event: QEvent) -> bool:
        """Tell the name of the patch under the mouse."""
        if isinstance(event, QHelpEvent) and self._names:
            inside = [i for i in range(len(self._names)) if self._place(i).contains(event.pos().toPointF())]
            words = (
                f"{self._names[inside[0]]}: held out {100 * self._held_out[inside[0]]:.2f} %"
                if inside
                else ""
            )
            QToolTip.showText(
                event.globalPos(), f"{words}. Left measured, right expected." if words else "", self
            )
            return True
        return super().event(event)
