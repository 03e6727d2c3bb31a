"""Whether black was darker than the lines after it, as it has to be: no line takes light away.

One that changed places with the first line shows its orders, too faint for the code to tell. The lines after
it leave most of those pixels as dark as black should have been.
"""

from __future__ import annotations

from collections import deque

import numpy as np
from numpy.typing import NDArray

from dsl_core.capture.proof.noise import Noise
from dsl_core.capture.proof.raster import Counts
from dsl_core.solve.normal import STD_OF_MEDIAN_SIZE
from dsl_core.solve.ranks import median

#: So many lines on end are asked, of the first ones after black.
TOGETHER, FIRST = 4, 32
#: A pixel is too bright in black if each of them is so many deviations darker. That so many pixels are, but
#: no greater share of all, is due to a line; light of the room changes everywhere.
SIGMAS, FEWEST, MOST = 4.0, 6, 0.2


class BrightBlack:
    """Compares black with the first lines of its setting."""

    def __init__(self, noise: Noise) -> None:
        """Start without any line."""
        self._noise = noise
        self._lines: dict[int, deque[NDArray[np.bool_]]] = {}
        self._counts: dict[int, int] = {}
        self._told: set[int] = set()

    def is_told(self, setting: int, seen: Counts, black: Counts) -> bool:
        """Whether a picture of a line and those before it say that black was too bright; once a setting.

        A black that is the same when it is taken again is what there is to see.
        """
        if setting in self._told or self._counts.get(setting, 0) >= FIRST:
            return False
        self._counts[setting] = self._counts.get(setting, 0) + 1
        lost = np.subtract(black, seen, dtype=np.float32)
        lost -= max(median(lost), np.float32(0))
        lost /= np.sqrt(self._noise.variance(seen) + self._noise.variance(black))
        # Most pixels show noise alone: a camera that has more than it is said to have says so itself.
        sigma = max(STD_OF_MEDIAN_SIZE * float(median(np.abs(lost - median(lost)))), 1.0)
        lines = self._lines.setdefault(setting, deque(maxlen=TOGETHER))
        lines.append(np.asarray(lost > SIGMAS * sigma))
        count = int(np.logical_and.reduce(lines).sum())
        if len(lines) < TOGETHER or not FEWEST <= count <= MOST * lost.size:
            return False
        self._told.add(setting)
        return True
