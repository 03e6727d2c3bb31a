"""A line of text that says where it is cut off."""

from __future__ import annotations

from PySide6.QtCore import QRect, Qt
from PySide6.QtGui import QPainter, QPaintEvent
from PySide6.QtWidgets import QLabel, QSizePolicy

DOTS = "…"


class ClippedLabel(QLabel):
    """A muted line that may be narrower than its text; it ends in an ellipsis there, and is copied whole."""

    def __init__(self) -> None:
        super().__init__()
        self.setTextFormat(Qt.TextFormat.PlainText)
        self.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        self.setSizePolicy(QSizePolicy.Policy.Ignored, self.sizePolicy().verticalPolicy())
        self.setProperty("role", "muted")

    @property
    def dots(self) -> QRect | None:
        """Where the ellipsis is; None while the text is whole."""
        room = self.contentsRect()
        if self.fontMetrics().horizontalAdvance(self.text()) <= room.width():
            return None
        width = self.fontMetrics().horizontalAdvance(f" {DOTS}")
        return room.adjusted(room.width() - width, 0, 0, 0)

    def paintEvent(self, event: QPaintEvent) -> None:
        """Paint the text, and the ellipsis over its end."""
        super().paintEvent(event)
        area = self.dots
        if area is not None:
            painter = QPainter(self)
            painter.fillRect(area, self.palette().window())
            painter.setPen(self.palette().windowText().color())
            painter.drawText(area, Qt.AlignmentFlag.AlignVCenter | Qt.AlignmentFlag.AlignRight, DOTS)
            painter.end()
