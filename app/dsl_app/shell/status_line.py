"""The status bar: messages, jobs, and hints that end in an ellipsis where these leave them no room."""

from __future__ import annotations

from PySide6.QtCore import QEvent, QRect, Qt
from PySide6.QtGui import QPainter, QPaintEvent
from PySide6.QtWidgets import QSizeGrip, QStatusBar, QStyle, QStyleOption, QWidget

from dsl_app.shell.short_text import LINES

#: Left of a hint, and between it and what is to its right, px.
EDGE_PX, GAP_PX = 6, 12
#: Above and below a message, px.
MARGIN_PX = 5


class StatusLine(QStatusBar):
    """Paints its hint itself: Qt's own is cut off in the middle of a letter, at the text of a job.

    Its height is that of a message with two lines, whether there is one or not: a page that made room would
    move what a person is about to click.
    """

    def __init__(self) -> None:
        super().__init__()
        self._painted_text = ""
        self._keep_height()

    def _keep_height(self) -> None:
        self.setFixedHeight(LINES * self.fontMetrics().lineSpacing() + 2 * MARGIN_PX)

    @property
    def room(self) -> QRect:
        """Where a hint may be: left of everything that is shown."""
        direct = Qt.FindChildOption.FindDirectChildrenOnly
        parts = self.findChildren(QWidget, options=direct)
        shown = (each for each in parts if each.isVisible() and not isinstance(each, QSizeGrip))
        right = min((each.x() for each in shown), default=self.width())
        return QRect(EDGE_PX, 0, max(right - EDGE_PX - GAP_PX, 0), self.height())

    @property
    def shown_text(self) -> str:
        """The hint as it fits."""
        mode = Qt.TextElideMode.ElideRight
        return self.fontMetrics().elidedText(self.currentMessage(), mode, self.room.width())

    def paintEvent(self, event: QPaintEvent) -> None:
        """Paint the background and the hint."""
        text = self.shown_text
        if text != self._painted_text:
            # What moved may have uncovered a part only; beside it, the old text would stay.
            self._painted_text = text
            self.update()
        option = QStyleOption()
        option.initFrom(self)
        painter = QPainter(self)
        self.style().drawPrimitive(QStyle.PrimitiveElement.PE_PanelStatusBar, option, painter, self)
        painter.setPen(self.palette().windowText().color())
        painter.drawText(self.room, Qt.AlignmentFlag.AlignVCenter | Qt.AlignmentFlag.AlignLeft, text)

    def event(self, event: QEvent) -> bool:
        """Paint again when jobs come and go, which moves the room of the hint."""
        if event.type() is QEvent.Type.LayoutRequest:
            self.update()
        elif event.type() is QEvent.Type.FontChange:
            self._keep_height()
        return super().event(event)
