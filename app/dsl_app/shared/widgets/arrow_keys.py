"""What arrow keys move a cursor by, the same in every picture."""

from __future__ import annotations

from PySide6.QtCore import Qt
from PySide6.QtGui import QKeyEvent

_STEPS = {
    Qt.Key.Key_Left: (-1, 0),
    Qt.Key.Key_Right: (1, 0),
    Qt.Key.Key_Up: (0, -1),
    Qt.Key.Key_Down: (0, 1),
}
#: How much further a step goes with Shift.
WITH_SHIFT = 10


def arrow_step(event: QKeyEvent) -> tuple[int, int] | None:
    """Steps to the right and down that a key asks for, ten times as far with Shift; None for other keys."""
    step = _STEPS.get(Qt.Key(event.key()))
    if step is None:
        return None
    by = WITH_SHIFT if event.modifiers() & Qt.KeyboardModifier.ShiftModifier else 1
    return by * step[0], by * step[1]


def moved_within(pixel: tuple[int, int], step: tuple[int, int], size: tuple[int, int]) -> tuple[int, int]:
    """A pixel (x, y) after a step, kept in an image of (width, height).

    >>> moved_within((3, 0), (10, -1), (8, 6))
    (7, 0)
    """
    x, y = (min(max(at + by, 0), most - 1) for at, by, most in zip(pixel, step, size, strict=True))
    return x, y
