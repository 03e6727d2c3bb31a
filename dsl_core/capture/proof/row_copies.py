"""Rows that come twice in a picture: packets of a camera's link that were sent again, or lost and filled up.

Noise makes every row of a picture another one, however alike what it shows is.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

#: Rows that come twice lie so far apart, and so many of them side by side.
DISTANCES, FEWEST = (1, 2, 4, 6, 8), 2
#: Where more of all rows do, they are as alike as that: without noise, or as a camera makes two of one.
MOST = 0.25
#: Columns that are looked at first; rows of fewer values than this are dark, saturated, or without noise.
LOOK, VALUES = 16, 8


def has_row_copies(pixels: NDArray[np.uint16]) -> bool:
    """Whether a few rows of a raw mosaic (rows, columns) are copies of those a little above."""
    some = pixels[:, :: max(pixels.shape[1] // LOOK, 1)]
    for distance in DISTANCES:
        likely = np.flatnonzero((some[distance:] == some[:-distance]).all(axis=1))
        if likely.size < FEWEST or likely.size > MOST * len(pixels):
            continue
        same = [row for row in likely if _is_copy(pixels[row], pixels[row + distance])]
        if any(after - before == 1 for before, after in pairwise(same)):
            return True
    return False


def _is_copy(one: NDArray[np.uint16], other: NDArray[np.uint16]) -> bool:
    return np.array_equal(one, other) and np.unique(one).size >= VALUES
