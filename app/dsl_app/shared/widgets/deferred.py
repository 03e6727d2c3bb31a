"""Widgets that are slow to make: made when they are first seen, one after the other, not all at once."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from functools import cache
from typing import Generic, TypeVar

from PySide6.QtCore import QObject, QSize, QTimer
from PySide6.QtGui import QShowEvent
from PySide6.QtWidgets import QWidget
from shiboken6 import isValid

from dsl_app.shared.theme import DARK, Theme
from dsl_app.shared.widgets.inside import apply_theme_to
from dsl_app.shared.widgets.layouts import column_of, tab_in_place

#: Between two deferred calls, ms: the window handles its other events.
PAUSE_MS = 30
#: The size hint of a widget that is not made yet: that of pictures and plots.
PLACEHOLDER = QSize(256, 192)
P = TypeVar("P", bound=QWidget)


class _CallQueue(QObject):
    """Makes the calls that wait, first come, first served, however long each takes."""

    def __init__(self) -> None:
        super().__init__()
        self._waiting: deque[tuple[QWidget, Callable[[], object]]] = deque()
        self._timer = QTimer(self)
        self._timer.setSingleShot(True)
        self._timer.setInterval(PAUSE_MS)
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
def _queue() -> _CallQueue:
    return _CallQueue()


def call_deferred(widget: QWidget, act: Callable[[], object]) -> None:
    """Call ``act`` after earlier deferred calls, unless the widget has been deleted by then."""
    _queue().add(widget, act)


class Deferred(QWidget, Generic[P]):
    """A placeholder: makes its content by a deferred call when it is first seen, or at once on request."""

    def __init__(self, make: Callable[[], P]) -> None:
        super().__init__()
        self._make, self._theme = make, DARK
        #: The content, once it has been made.
        self.made: P | None = None
        self._is_queued = False
        self._column = column_of(on=self, margins=0)

    @property
    def content(self) -> P:
        """The content, made now if need be."""
        if self.made is None:
            self.made = self._make()
            apply_theme_to(self.made, self._theme)
            self._column.addWidget(self.made)
            # Before it takes the focus for this widget, which Qt would move with it.
            tab_in_place(self)
            self.setFocusProxy(self.made)
        return self.made

    def sizeHint(self) -> QSize:
        """The size that the content will need, as far as that is known: splitters share it out before."""
        return super().sizeHint() if self.made is not None else PLACEHOLDER

    def showEvent(self, event: QShowEvent) -> None:
        """Make the content soon."""
        super().showEvent(event)
        if self.made is None and not self._is_queued:
            self._is_queued = True
            call_deferred(self, self._make_if_visible)

    def _make_if_visible(self) -> None:
        self._is_queued = False
        # Another page may have been opened meanwhile; that one does not wait for this.
        if self.isVisible():
            _ = self.content

    def apply_theme(self, theme: Theme) -> None:
        """Apply the colours of a theme, now or when the content is made."""
        self._theme = theme
        if self.made is not None:
            apply_theme_to(self.made, theme)
