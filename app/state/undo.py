"""Undo and redo of pins, regions, masks and settings; no Qt."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from app.state.evented import Event

#: Changes that are kept.
DEPTH = 200


@dataclass(frozen=True)
class Change:
    """Something that was done, in words, and how to do it and take it back."""

    text: str
    do: Callable[[], object]
    undo: Callable[[], object]


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

    def undo(self) -> None:
        """Take the last change back; nothing happens when there is none."""
        if self._done:
            change = self._done.pop()
            change.undo()
            self._undone.append(change)
            self.changed.emit(None)

    def redo(self) -> None:
        """Do the change again that was taken back last; nothing happens when there is none."""
        if self._undone:
            change = self._undone.pop()
            change.do()
            self._done.append(change)
            self.changed.emit(None)

    def clear(self) -> None:
        """Forget everything, as when another result is opened."""
        self._done.clear()
        self._undone.clear()
        self.changed.emit(None)
