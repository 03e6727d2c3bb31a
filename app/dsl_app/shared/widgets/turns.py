"""Turns: what is slow to make is made one after the other, and the window comes round in between."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from functools import cache

from PySide6.QtCore import QObject, QTimer
from PySide6.QtWidgets import QWidget
from shiboken6 import isValid

#: Between two turns, ms: the window does what else there is to do.
TURN_MS = 30


class _Turns(QObject):
    """Calls what waits, first come, first served, however long each takes."""

    def __init__(self) -> None:
        super().__init__()
        self._waiting: deque[tuple[QWidget, Callable[[], object]]] = deque()
        self._timer = QTimer(self)
        self._timer.setSingleShot(True)
        self._timer.setInterval(TURN_MS)
        self._timer.timeout.connect(self._next)

    def add(self, widget: QWidget, act: Callable[[], object]) -> None:
        self._waiting.append((widget, act))
        if not self._timer.isActive():
            self._timer.start()

    def _next(self) -> None:
        widget, act = self._waiting.popleft()
        try:
            # Its window may have been closed meanwhile.
            if isValid(widget):
                act()
        finally:
            if self._waiting:
                self._timer.start()


@cache
def _turns() -> _Turns:
    return _Turns()


def take_turn(widget: QWidget, act: Callable[[], object]) -> None:
    """Call ``act`` in a turn of its own, unless the widget is gone by then."""
    _turns().add(widget, act)
