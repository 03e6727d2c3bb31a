"""Undo and redo of pins, regions, masks and settings; no Qt."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from dsl_app.shared.evented import Event

#: Changes that are kept.
DEPTH = 200


@dataclass(frozen=True)
class Change:
    """Something that was done, in words, and how to do it and take it back.

    ``obstacle`` says why neither can be at this moment; empty when nothing is in the way.
    """

    text: str
    do: Callable[[], object]
    undo: Callable[[], object]
    obstacle: Callable[[], str] = str


class UndoStack:
    """What was done, last first; a new change forgets what was taken back."""

    def __init__(self) -> None:
        self._done: list[Change] = []
        self._undone: list[Change] = []
        self.changed: Event[None] = Event()

    @property
    def undo_text(self) -> str:
        """What the next undo takes back, empty for nothing."""
        return self._done[-1].text if self._done else ""

    @property
    def redo_text(self) -> str:
        """What the next redo does again, empty for nothing."""
        return self._undone[-1].text if self._undone else ""

    def push(self, change: Change) -> None:
        """Do a change and remember it."""
        change.do()
        self._done = [*self._done, change][-DEPTH:]
        self._undone.clear()
        self.changed.emit(None)

    def undo(self) -> str:
        """Take the last change back; the reason where that cannot be now, and then it stays the last one."""
        return self._move(self._done, self._undone, lambda change: change.undo())

    def redo(self) -> str:
        """Do the change again that was taken back last; the reason where that cannot be now."""
        return self._move(self._undone, self._done, lambda change: change.do())

    def _move(self, source: list[Change], target: list[Change], act: Callable[[Change], object]) -> str:
        if not source:
            return ""
        reason = source[-1].obstacle()
        if not reason:
            change = source.pop()
            act(change)
            target.append(change)
            self.changed.emit(None)
        return reason

    def clear(self) -> None:
        """Forget everything, as when another result is opened."""
        self._done.clear()
        self._undone.clear()
        self.changed.emit(None)
