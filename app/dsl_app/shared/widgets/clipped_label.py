"""A line of text that says where it is cut off."""

from __future__ import annotations

from PySide6.QtCore import Qt
from PySide6.QtGui import QPainter, QPaintEvent
from PySide6.QtWidgets import QLabel, QSizePolicy

#: What is between two parts of a line.
BETWEEN = " · "
#: A last part of which less than this is left says nothing: the line is cut at its end, px.
LEAST_PX = 60


class ClippedLabel(QLabel):
    """A muted line that may be narrower than its text; copied whole.

    Its last part loses its middle first: of a path, the name at its end says most.
    """

    def __init__(self) -> None:
        super().__init__()
        self.setTextFormat(Qt.TextFormat.PlainText)
        self.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        self.setSizePolicy(QSizePolicy.Policy.Ignored, self.sizePolicy().verticalPolicy())
        self.setProperty("role", "muted")

    @property
    def shown(self) -> str:
        """The text as it fits."""
        text, metrics, room_px = self.text(), self.fontMetrics(), self.contentsRect().width()
        if metrics.horizontalAdvance(text) <= room_px:
            return text
        head, between, last = text.rpartition(BETWEEN)
        left_px = room_px - metrics.horizontalAdvance(head + between)
        if left_px < LEAST_PX:
            return metrics.elidedText(text, Qt.TextElideMode.ElideRight, room_px)
        return head + between + metrics.elidedText(last, Qt.TextElideMode.ElideMiddle, left_px)

    def paintEvent(self, event: QPaintEvent) -> None:
        """Paint the text as it fits; while some of it is selected, from its beginning."""
        shown = self.shown
        if shown == self.text() or self.hasSelectedText():
            super().paintEvent(event)
            return
        painter = QPainter(self)
        painter.setPen(self.palette().windowText().color())
        side = Qt.AlignmentFlag.AlignVCenter | Qt.AlignmentFlag.AlignLeft | Qt.TextFlag.TextSingleLine
        painter.drawText(self.contentsRect(), side, shown)
        painter.end()
