"""Measuring in the point cloud."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float32] | NDArray[np.float64]


@dataclass(frozen=True)
class Distance:
    """The straight distance between two points and its standard deviation, mm."""

    mm: float
    std_mm: float


def distance_between(a_mm: Floats, b_mm: Floats, a_std_mm: float = 0.0, b_std_mm: float = 0.0) -> Distance:
    """Distance of two points (3,) in camera coordinates; ``std`` are those of their depths.

    A wrong depth moves a point along its ray, of which only the part along the connection counts; errors of
    the two depths are taken as independent. NaN where a point is.
    """
    a, b = np.asarray(a_mm, np.float64), np.asarray(b_mm, np.float64)
    between = b - a
    length = float(np.linalg.norm(between))
    if length == 0.0:
        return Distance(0.0, float(np.hypot(a_std_mm, b_std_mm)))
    along = between / length
    shift_a, shift_b = a_std_mm * along @ (a / a[2]), b_std_mm * along @ (b / b[2])
    return Distance(length, float(np.hypot(shift_a, shift_b)))


def on_screen(points_mm: Floats, projection: NDArray[np.float64]) -> NDArray[np.float64]:
    """Normalised screen coordinates and depth (n, 3) of points (n, 3) by a 4 x 4 view and projection matrix.

    x and y run from -1 to 1 over the screen; a point behind the eye is NaN.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        clip = points_mm @ projection[:, :3].T + projection[:, 3]
        return np.asarray(np.where(clip[:, 3:] > 0, clip[:, :3] / clip[:, 3:], np.nan))


def nearest_on_screen(
    seen: NDArray[np.float64], at: tuple[float, float], size_px: tuple[int, int], within_px: float = 6.0
) -> int | None:
    """Index of the point of `on_screen` that a person means who points at ``at`` (normalised).

    Of the points within a few pixels it is the foremost; None where there is none.
    """
    dx = (seen[:, 0] - at[0]) * size_px[0] / 2
    dy = (seen[:, 1] - at[1]) * size_px[1] / 2
    near = np.flatnonzero(dx * dx + dy * dy < within_px**2)
    return None if near.size == 0 else int(near[np.argmin(seen[near, 2])])
