"""Frame numbers that rise for as long as a camera is open, from counters that wrap, restart or start at 0."""

from __future__ import annotations

#: Block ids of GigE Vision 1 have 16 bits, and leave out 0: 65535 is followed by 1.
GIGE_LAST = 65535


class FrameCounter:
    """Turns the ids that a camera gives its frames into numbers that rise by at least one.

    An id lower than the one before is taken for a wrap after ``last`` where both are near its ends, else for
    a counter that started again. A repeated id gives the same number again: it is the same frame.
    """

    def __init__(self, last: int = GIGE_LAST) -> None:
        self._last = last
        self._offset = 0
        self._before: int | None = None
        self._highest = -1

    def number(self, frame_id: int) -> int:
        """The number of the frame with this id."""
        before, self._before = self._before, frame_id
        if before is None:
            # The first of a connection follows the last of the one before, as if nothing had been missed.
            self._offset = self._highest + 1 - frame_id if self._highest >= 0 else 0
        elif frame_id < before:
            wrapped = before > 0.75 * self._last and frame_id < 0.25 * self._last
            self._offset = self._offset + self._last if wrapped else self._highest + 1 - frame_id
            # Counters that start at 0 give it after the last, too.
            self._offset = max(self._offset, self._highest + 1 - frame_id)
        number = self._offset + frame_id
        self._highest = max(self._highest, number)
        return number

    def restart(self) -> None:
        """The camera was opened again: whatever id comes next follows the last."""
        self._before = None
