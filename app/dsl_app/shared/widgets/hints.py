"""What can be done with a plot or a picture, said where it covers nothing, and which of them has the keys."""

from __future__ import annotations

from PySide6.QtCore import QEvent, QObject, Qt
from PySide6.QtGui import QFocusEvent, QPainter, QPaintEvent, QPen
from PySide6.QtWidgets import QMainWindow, QWidget

from dsl_app.shared.widgets.forms import named

_Reason = Qt.FocusReason
#: How the keys come to a widget without the mouse, which shows by itself where it is.
BY_KEYS = (_Reason.TabFocusReason, _Reason.BacktabFocusReason, _Reason.ShortcutFocusReason)
#: How they leave it and come back to it.
FOR_A_WHILE = (_Reason.ActiveWindowFocusReason, _Reason.PopupFocusReason, _Reason.MenuBarFocusReason)
#: Width of the frame, px.
RING_PX = 2


def hint(widget: QWidget, name: str, text: str) -> None:
    """Name a plot or picture for screen readers, and say in the status line what can be done with it.

    A frame shows when the Tab key has come to it.

    The widget leaves out the events of which `is_said_below` is true: its tooltip would cover the data. In a
    window without a status line it is shown.
    """
    named(widget, name, text)
    widget.setStatusTip(text)
    FocusRing(widget)


def is_said_below(widget: QWidget, event: QEvent) -> bool:
    """Whether an event asks for a tooltip that the status line of the window has already."""
    return event.type() is QEvent.Type.ToolTip and isinstance(widget.window(), QMainWindow)


class FocusRing(QWidget):
    """A frame around what has the keys and does not show it by itself: pictures, plots and long texts.

    It is there once a person came by keys to ``owner``, which it lies on, or on a part ``around`` of it.
    """

    def __init__(self, owner: QWidget, around: QWidget | None = None) -> None:
        self._owner, self._around = owner, around or owner
        super().__init__(self._around)
        self.setAttribute(Qt.WidgetAttribute.WA_TransparentForMouseEvents)
        self.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        self.hide()
        for watched in {owner, self._around}:
            watched.installEventFilter(self)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        """Come and go with the keys, and stay as large as what it lies on."""
        kind = event.type()
        if kind is QEvent.Type.Resize and watched is self._around:
            self.setGeometry(self._around.rect())
        elif isinstance(event, QFocusEvent) and watched is self._owner:
            if kind is QEvent.Type.FocusIn and event.reason() in BY_KEYS:
                self.setGeometry(self._around.rect())
                self.raise_()
                self.show()
            elif event.reason() not in FOR_A_WHILE:
                self.hide()
        return False

    def paintEvent(self, event: QPaintEvent) -> None:
        """Paint the frame in the colour of what is selected."""
        pen = QPen(self.palette().highlight().color(), RING_PX)
        pen.setJoinStyle(Qt.PenJoinStyle.MiterJoin)
        painter, half = QPainter(self), RING_PX // 2
        painter.setPen(pen)
        painter.drawRect(self.rect().adjusted(half, half, -half, -half))
