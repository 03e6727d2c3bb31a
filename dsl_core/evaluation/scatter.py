"""How sure a figure over many pixels is: by its scatter over blocks, as pixels near each other err alike."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.floating[Any]]
#: Blocks of an image, rows and columns.
_BLOCKS = (6, 8)


def rms_std(error: Floats) -> float | None:
    """Standard deviation of the RMS of an error map (h, w), NaN where it does not count.

    None where fewer than two blocks have any pixel, or nothing has an error.
    """
    return std_of_rms([float(np.mean(known**2)) for known in _blocks(error)])


def mean_std(values: Floats) -> float | None:
    """Standard deviation of the mean of a map (h, w), NaN where it does not count; None as `rms_std`."""
    return _over_blocks(values, np.mean)


def median_std(values: Floats) -> float | None:
    """Standard deviation of the median of a map (h, w), NaN where it does not count; None as `rms_std`."""
    return _over_blocks(values, np.median)


def std_of_mean(values: Sequence[float]) -> float | None:
    """Standard deviation of the mean of values that err independently; None for fewer than two."""
    if len(values) < 2:
        return None
    return float(np.std(values, ddof=1)) / math.sqrt(len(values))


def std_of_rms(squares: Sequence[float]) -> float | None:
    """Standard deviation of the root of the mean of squares that scatter independently; None as `rms_std`."""
    spread = std_of_mean(squares)
    if spread is None or not any(squares):
        return None
    # The root halves the relative deviation of the mean square.
    return spread / (2 * math.sqrt(float(np.mean(squares))))


def _over_blocks(values: Floats, middle: Callable[[Floats], Any]) -> float | None:
    return std_of_mean([float(middle(known)) for known in _blocks(values)])


def _blocks(values: Floats) -> Iterator[Floats]:
    """What is known of each block that has anything."""
    for rows in np.array_split(np.asarray(values, np.float64), _BLOCKS[0], axis=0):
        for block in np.array_split(rows, _BLOCKS[1], axis=1):
            known = block[np.isfinite(block)]
            if known.size:
                yield known
