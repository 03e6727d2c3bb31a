"""Undo and redo of pins, regions, masks and settings; no Qt."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from dsl_app.shared.evented import Event

#: Changes that are kept.
DEPTH = 200


@dataclass(frozen=True)
class Change:
    """A change in words, and how to do and undo it.

    ``obstacle`` says why neither is possible now; empty when both are. ``owner`` is whoever may have it
    forgotten.
    """

    text: str
    do: Callable[[], object]
    undo: Callable[[], object]
    obstacle: Callable[[], str] = str
    owner: object = None


class UndoStack:
    """Changes that can be undone and redone; a new change clears those that were undone."""

    def __init__(self) -> None:
        self._done: list[Change] = []
        self._undone: list[Change] = []
        self.changed: Event[None] = Event()

    @property
    def undo_text(self) -> str:
        """The change that undo would undo, empty for none."""
        return self._done[-1].text if self._done else ""

    @property
    def redo_text(self) -> str:
        """The change that redo would redo, empty for none."""
        return self._undone[-1].text if self._undone else ""

    def push(self, change: Change) -> None:
        """Do a change and remember it."""
        change.do()
        self._done = [*self._done, change][-DEPTH:]
        self._undone.clear()
        self.changed.emit(None)

    def undo(self) -> str:
        """Undo the last change; if that is not possible now, returns the reason and changes nothing."""
        return self._move(self._done, self._undone, lambda change: change.undo())

    def redo(self) -> str:
        """Redo the change that was undone last; if that is not possible now, returns the reason."""
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

    def forget(self, owner: object) -> None:
        """Forget the changes of an owner, as those of a result when another one is opened."""
        for changes in (self._done, self._undone):
            changes[:] = [change for change in changes if change.owner is not owner]
        self.changed.emit(None)
