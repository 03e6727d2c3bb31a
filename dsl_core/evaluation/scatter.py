"""How sure a figure over many pixels is: by its scatter over blocks, as pixels near each other err alike.

Blocks divide the part of the picture that has anything. Each counts as much as it has pixels: a figure is the
ratio of two sums over blocks, and its variance that of the ratio estimator (Cochran, Sampling Techniques,
1977, chapter 6, for an endless population).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.floating[Any]]
#: Blocks of an image, rows and columns.
_BLOCKS = (6, 8)
#: The median of a block with fewer pixels than this share of the fullest one's says little.
_LEAST_SHARE = 0.1


def rms_std(error: Floats) -> float | None:
    """Standard deviation of the RMS of an error map (h, w), NaN where it does not count.

    None where fewer than two blocks have any pixel, or nothing has an error.
    """
    blocks = list(_blocks(error))
    return std_of_rms([float(np.mean(known**2)) for known in blocks], [known.size for known in blocks])


def mean_std(values: Floats) -> float | None:
    """Standard deviation of the mean of a map (h, w), NaN where it does not count; None as `rms_std`."""
    return _over_blocks(values, np.mean, 0.0)


def median_std(values: Floats) -> float | None:
    """Standard deviation of the median of a map (h, w), NaN where it does not count; None as `rms_std`."""
    return _over_blocks(values, np.median, _LEAST_SHARE)


def std_of_mean(values: Sequence[float], weights: Sequence[float] | None = None) -> float | None:
    """Standard deviation of the weighted mean of values that err independently; None for fewer than two."""
    count = len(values)
    if count < 2:
        return None
    share = np.full(count, 1.0 / count) if weights is None else np.asarray(weights) / np.sum(weights)
    off = np.asarray(values) - np.sum(share * values)
    return math.sqrt(count / (count - 1) * float(np.sum((share * off) ** 2)))


def std_of_rms(squares: Sequence[float], weights: Sequence[float] | None = None) -> float | None:
    """Standard deviation of the root of the weighted mean of squares; None as `rms_std`."""
    spread = std_of_mean(squares, weights)
    if spread is None or not any(squares):
        return None
    # The root halves the relative deviation of the mean square.
    return spread / (2 * math.sqrt(float(np.average(squares, weights=weights))))


def _over_blocks(values: Floats, middle: Callable[[Floats], Any], least_share: float) -> float | None:
    blocks = list(_blocks(values))
    fullest = max((known.size for known in blocks), default=0)
    blocks = [known for known in blocks if known.size >= least_share * fullest]
    return std_of_mean([float(middle(known)) for known in blocks], [known.size for known in blocks])


def _blocks(values: Floats) -> Iterator[Floats]:
    """What is known of each block that has anything."""
    known = np.isfinite(values)
    rows_known, columns_known = np.flatnonzero(known.any(axis=1)), np.flatnonzero(known.any(axis=0))
    if not rows_known.size:
        return
    part = values[rows_known[0] : rows_known[-1] + 1, columns_known[0] : columns_known[-1] + 1]
    for rows in np.array_split(np.asarray(part, np.float64), _BLOCKS[0], axis=0):
        for block in np.array_split(rows, _BLOCKS[1], axis=1):
            found = block[np.isfinite(block)]
            if found.size:
                yield found
