"""Where the values of pictures end, which no file states: at a sensor's limit, or with room above all."""

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
#: Values below a limit run on up to it: all of so many parts of this share of them occur in the same picture.
#: Those of a wall that a program drew end in a step.
_BELOW, _PARTS = 0.1, 5
#: How many times as common as one of them, on average, the value of a limit is: what is brighter ends there.
_PILED = 4.0
#: Room above the largest value where there is no such limit, so that nothing seems to be saturated.
_ROOM = 1.05


class ValueScale:
    """Looks at the pictures of a capture, one after the other."""

    def __init__(self) -> None:
        self._most, self._bright, self._at_most, self._pixels = 0.0, 0.0, 0, 0
        self._most_of_one, self._is_cut = 0, False

    def add(self, values: NDArray[Any]) -> None:
        """Look at a picture of any shape."""
        most = float(values.max())
        if most > self._most:
            self._most, self._at_most, self._most_of_one = most, 0, 0
        here = int(np.count_nonzero(values == self._most))
        self._at_most += here
        if here > self._most_of_one:
            # The picture that a limit cuts most, which is white as a rule, tells.
            self._most_of_one, self._is_cut = here, _is_cut(values, self._most, here)
        rank = values.size - 1 - int(values.size * SPARKS)
        self._bright = max(self._bright, float(np.partition(values.ravel(), rank)[rank]))
        self._pixels += values.size

    @property
    def limit(self) -> float | None:
        """The largest value if a sensor's limit cuts off all that is brighter; None if nothing shows that."""
        piled = self._at_most > _AT_LIMIT * self._pixels
        return self._most if piled and self._is_cut and 0 < self._most < np.inf else None

    @property
    def white(self) -> float | None:
        """The value of white; None if all pictures are black or one has no finite largest value."""
        if not 0 < self._most < np.inf:
            return None
        if self.limit is not None:
            return self._most
        return min(self._most, _AWAY * self._bright or self._most) * _ROOM


def _is_cut(values: NDArray[Any], most: float, at_most: int) -> bool:
    """Whether the values of a picture go on up to the largest and then pile up there."""
    below = values[(values < most) & (values >= (1 - _BELOW) * most)]
    if not below.size:
        return False
    parts = np.floor((most - below.astype(np.float64)) / (_BELOW * most) * _PARTS).astype(int)
    is_steady = len(np.unique(parts.clip(0, _PARTS - 1))) == _PARTS
    return is_steady and at_most > _PILED * below.size / len(np.unique(below))
