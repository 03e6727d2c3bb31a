"""A part of many pixels, or rows of a picture, spread over all of it and of every colour of its mosaic."""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

T = TypeVar("T", bound=np.generic)
#: Fewer of the rows than this share may not be of one parity, whose colours would hardly be seen.
LEAST_SHARE = 0.25


def thinned(values: NDArray[T], about: int) -> NDArray[T]:
    """Every n-th of ``values`` (count,), n odd: at most twice ``about``, all where there are fewer.

    Pixels of a picture are numbered along its rows. An even step would see every other column alone, and
    with it only two of the four sites of a colour mosaic.
    """
    return values[:: len(values) // about | 1]


def spread_rows(height: int, count: int) -> NDArray[np.intp]:
    """About ``count`` rows of a ``height``, in their order; all where there are no more.

    Evenly spread rows may all be even, and lack the colours of odd ones: then they take turns.

    >>> spread_rows(71, 36)[:6].tolist(), spread_rows(3, 36).tolist()
    ([0, 3, 4, 7, 8, 11], [0, 1, 2])
    """
    rows = np.linspace(0, height - 1, min(height, count)).round().astype(np.intp)
    if rows.size > 1 and abs(np.mean(rows % 2) - 0.5) > 0.5 - LEAST_SHARE:
        rows = np.minimum(rows // 2 * 2 + np.arange(rows.size) % 2, height - 1)
    return np.unique(rows)
