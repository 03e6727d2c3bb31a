"""The white of pictures that hold fractions: where their camera or renderer ends, which no file states."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

#: Share of a picture's pixels that may be brighter than all that matters: sparks of a renderer, hot pixels.
SPARKS = 1e-3
#: How many times as bright as the brightest of the others such pixels have to be.
_AWAY = 2.0
#: Share of pixels with the very same largest value that a sensor's limit gives.
_AT_LIMIT = 2e-4
#: Room above the largest value where there is no such limit, so that nothing seems to be saturated.
_ROOM = 1.05


class FloatScale:
    """Looks at the pictures of a capture, one after the other."""

    def __init__(self) -> None:
        self._most, self._bright, self._at_most, self._pixels = 0.0, 0.0, 0, 0

    def add(self, values: NDArray[Any]) -> None:
        """Look at a picture of any shape."""
        most = float(values.max())
        if most > self._most:
            self._most, self._at_most = most, 0
        self._at_most += int(np.count_nonzero(values == self._most))
        rank = values.size - 1 - int(values.size * SPARKS)
        self._bright = max(self._bright, float(np.partition(values.ravel(), rank)[rank]))
        self._pixels += values.size

    @property
    def white(self) -> float | None:
        """The value of white; None if all pictures are black or one has no finite largest value."""
        if not 0 < self._most < np.inf:
            return None
        if self._at_most > _AT_LIMIT * self._pixels:
            return self._most
        return min(self._most, _AWAY * self._bright or self._most) * _ROOM
