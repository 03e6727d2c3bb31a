"""Room for a widget that is slow to make."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Generic, TypeVar

from PySide6.QtCore import QSize
from PySide6.QtGui import QShowEvent
from PySide6.QtWidgets import QVBoxLayout, QWidget

from dsl_app.shared.theme import DARK, Theme
from dsl_app.shared.widgets.turns import take_turn

#: What pictures and plots ask for, too.
ROOM = QSize(256, 192)
P = TypeVar("P", bound=QWidget)


class Late(QWidget, Generic[P]):
    """Makes a part in a turn of its own when its room is first seen, or at once when it is asked for.

    A part is a widget with ``apply_theme``.
    """

    def __init__(self, make: Callable[[], P]) -> None:
        super().__init__()
        self._make, self._theme = make, DARK
        #: The part, once there is one.
        self.made: P | None = None
        self._is_next = False
        self._column = QVBoxLayout(self)
        self._column.setContentsMargins(0, 0, 0, 0)

    @property
    def part(self) -> P:
        """The part, made now if need be."""
        if self.made is None:
            self.made = self._make()
            _apply(self._theme, self.made)
            self._column.addWidget(self.made)
            self.setFocusProxy(self.made)
        return self.made

    def sizeHint(self) -> QSize:
        """The room that a part will want, as far as that is known: splitters share it out before."""
        return super().sizeHint() if self.made is not None else ROOM

    def showEvent(self, event: QShowEvent) -> None:
        """Make the part soon."""
        super().showEvent(event)
        if self.made is None and not self._is_next:
            self._is_next = True
            take_turn(self, self._take_turn)

    def _take_turn(self) -> None:
        self._is_next = False
        # Who leafed on meanwhile does not wait for it.
        if self.isVisible():
            _ = self.part

    def apply_theme(self, theme: Theme) -> None:
        """Take the colours of a theme, now or when there is a part."""
        self._theme = theme
        if self.made is not None:
            _apply(theme, self.made)


def _apply(theme: Theme, part: Any) -> None:
    part.apply_theme(theme)
