"""Whether columns of neighbouring pixels scatter as their deviations say.

A pixel whose spot a texture fills by halves sees a place beside its middle. Where the texture is finer than
pixels no picture shows that, but neighbours are displaced by other parts of it: their columns scatter about
a smooth surface by more than noise makes them.

Errors that go with the place between two scan lines are no such scatter, and deviations hold them already.
Where that place alternates from pixel to pixel, so do they, and differences of neighbours show them as twice
what they are, those of every second pixel as none: the mean of both is nearly what a pixel is off.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from dsl_core.solve.robust import robust_std

#: Differences of five neighbours that leave no plane and no even curve, how far apart these are, and the
#: pixels of a tile.
DIFFERENCES, APART_PX, TILE_PX = (1.0, -4.0, 6.0, -4.0, 1.0), (1, 2), 16
#: Differences that a tile must have, and by how many times they exceed what deviations say if it matters.
FEWEST, MATTERS = 40, 3.0


@dataclass(frozen=True)
class Scatter:
    """What deviations lack, px (rows, columns), and the ratio of scatter to them, 1 where it is usual."""

    error_px: NDArray[np.float32]
    ratio: NDArray[np.float32]


def scatter_of(
    column_px: NDArray[np.floating], std_px: NDArray[np.floating], usable: NDArray[np.bool_]
) -> Scatter | None:
    """What columns with their deviations, maps (rows, columns), scatter by beyond these; None if by nothing.

    Only ``usable`` pixels, of smooth surfaces, are asked; what most of a tile asks for holds for all of it.
    """
    own = np.where(usable, std_px, np.nan)
    column = np.where(usable, column_px, np.nan)
    differences = [[_over_deviation(column, own, axis, apart) for apart in APART_PX] for axis in (0, 1)]
    ratio = np.ones(column_px.shape, np.float32)
    rows, columns = (
        np.linspace(0, size, max(round(size / TILE_PX), 1) + 1).astype(int) for size in column_px.shape
    )
    for top, bottom in pairwise(rows):
        for left, right in pairwise(columns):
            where = np.s_[top:bottom, left:right]
            # Textures may lie along rows, or along columns.
            found = [_both(*(_scale(each[where]) for each in of_axis)) for of_axis in differences]
            ratio[where] = max(*found, 1.0)
    ratio[ratio < MATTERS] = 1.0
    if not (ratio > 1).any():
        return None
    error = np.nan_to_num(std_px) * np.sqrt(ratio**2 - 1)
    return Scatter(error.astype(np.float32), ratio)


def _over_deviation(
    column_px: NDArray[np.floating], std_px: NDArray[np.floating], axis: int, apart_px: int
) -> NDArray[np.float64]:
    """Differences along an axis over their deviations, (rows, columns); NaN where a pixel is missing."""
    total, variance = np.zeros((2, *column_px.shape))
    for away, factor in zip((-2, -1, 0, 1, 2), DIFFERENCES, strict=True):
        total += factor * np.roll(column_px, away * apart_px, axis)
        variance += (factor * np.roll(std_px, away * apart_px, axis)) ** 2
    ends = [slice(None)] * 2
    for ends[axis] in (slice(0, 2 * apart_px), slice(-2 * apart_px, None)):
        total[tuple(ends)] = np.nan
    return np.asarray(total / np.sqrt(variance))


def _both(next_ones: float, second_ones: float) -> float:
    """Scatter by differences of next neighbours and of every second one, which see more of the surface."""
    return float(np.sqrt((next_ones**2 + min(next_ones, second_ones) ** 2) / 2))


def _scale(differences: NDArray[np.float64]) -> float:
    known = differences[np.isfinite(differences)]
    return float(robust_std(known)) if known.size >= FEWEST else 1.0
