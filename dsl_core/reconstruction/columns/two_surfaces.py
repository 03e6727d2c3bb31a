"""How far columns of unusual peaks may be off because two surfaces share the pixel.

A peak out of focus is as wide as two peaks that are close together. Neighbours tell them apart: where the
surface goes on smoothly, what is left and right, above and below leads to the same column.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

#: Deviation of a column that neighbours on one side alone, or on none, say nothing of, px.
UNKNOWN_PX = 1.0
#: Neighbours of a smooth surface disagree by up to this much, px, by noise and by its curvature.
SMOOTH_PX = 0.25


def two_surfaces_std_px(column_px: NDArray[np.floating], unusual: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Deviation (px) of ``unusual`` columns by what their neighbours lead to, 0 elsewhere.

    Maps have shape (rows, columns); columns are NaN where nothing is known. Half the disagreement of both
    sides, each continued straight, is how far the mean of two surfaces is from either.
    """
    found = np.zeros(column_px.shape, np.float32)
    rows, columns = np.nonzero(unusual)
    if not rows.size:
        return found
    known = np.pad(column_px.astype(np.float64), 2, constant_values=np.nan)

    def beside(down: int, across: int) -> NDArray[np.float64]:
        return np.asarray(known[rows + 2 + down, columns + 2 + across])

    apart = [
        np.abs((2 * beside(y, x) - beside(2 * y, 2 * x)) - (2 * beside(-y, -x) - beside(-2 * y, -2 * x)))
        for y, x in ((0, 1), (1, 0))
    ]
    jump_px = (np.maximum(*apart) - SMOOTH_PX).clip(0)
    found[rows, columns] = np.nan_to_num(0.5 * jump_px, nan=UNKNOWN_PX)
    return found
