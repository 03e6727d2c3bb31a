"""How far columns may be off because two surfaces share the pixel.

A peak out of focus is as wide as two peaks that are close together, and no peak at all may be two that are
far apart. Neighbours tell: where the surface goes on smoothly, what is left and right, above and below leads
to the same column.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

#: Deviation of an unusual column that neighbours on one side alone, or on none, say nothing of, px.
UNKNOWN_PX = 1.0
#: Neighbours of a smooth surface disagree by up to this much, px, by noise and by its curvature.
SMOOTH_PX = 0.25
#: The mean of two surfaces is so much of what is between them from either.
OF_MEAN = 0.5
#: A column without a peak is that of either surface or between them, nobody knows where: it is off by an even
#: share of all that. Neighbours must disagree by so many of their deviations.
OF_EITHER, SIGMAS = 3**-0.5, 4.0


def two_surfaces_std_px(
    column_px: NDArray[np.floating],
    std_px: NDArray[np.floating],
    unusual: NDArray[np.bool_],
    without_peak: NDArray[np.bool_],
) -> NDArray[np.float32]:
    """Deviation (px) by what their neighbours lead to of columns that are ``unusual`` or have no peak.

    It is 0 elsewhere. Maps have shape (rows, columns); columns are NaN where nothing is known, ``std_px`` is
    their noise. Both sides are continued straight.
    """
    found = np.zeros(column_px.shape, np.float32)
    column, std = (np.pad(each.astype(np.float64), 2, constant_values=np.nan) for each in (column_px, std_px))
    for mask, share, sigmas, unknown_px in (
        (unusual, OF_MEAN, 0.0, UNKNOWN_PX),
        (without_peak & ~unusual, OF_EITHER, SIGMAS, 0.0),
    ):
        at = np.nonzero(mask)
        jumps = [_jump_px(column, std, at, step, sigmas) for step in ((0, 1), (1, 0))]
        found[at] = np.nan_to_num(share * np.maximum(*jumps), nan=unknown_px)
    return found


def _jump_px(
    column_px: NDArray[np.float64],
    std_px: NDArray[np.float64],
    at: tuple[NDArray[np.intp], ...],
    step: tuple[int, int],
    sigmas: float,
) -> NDArray[np.float64]:
    """What both sides of pixels disagree by beyond what smooth surfaces and noise do, px.

    Maps are padded by two pixels; ``step`` leads to a neighbour, down and across.
    """

    def beside(values: NDArray[np.float64], times: int) -> NDArray[np.float64]:
        return np.asarray(values[at[0] + 2 + times * step[0], at[1] + 2 + times * step[1]])

    after, before = (2 * beside(column_px, near) - beside(column_px, 2 * near) for near in (1, -1))
    apart = np.abs(after - before)
    noise = np.sqrt(
        sum((weight * beside(std_px, n)) ** 2 for n, weight in ((1, 2), (2, 1), (-1, 2), (-2, 1)))
    )
    jump = (apart - SMOOTH_PX).clip(0)
    return np.where(apart < sigmas * noise, 0.0, jump)
