"""What can be seen of points in a view: sizes on the screen, and which points others hide."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dsl_core.evaluation.marks import on_screen

Floats = NDArray[np.float32] | NDArray[np.float64]

#: Smallest size of the cells in which points hide others, px.
LEAST_CELL_PX = 3.0
#: A surface this steep to the view is not hidden by its own nearer side: tangent of 80 degrees.
STEEPEST = 5.7


def mm_per_px(point_mm: Floats, projection: NDArray[np.float64], height_px: int) -> float:
    """How long one pixel of a view is at the depth of a point (3,), by a 4 x 4 matrix of view and projection.

    Rotations keep lengths, so the second row of the matrix is as long as the view is magnified. NaN behind
    the eye.
    """
    away = float(projection[3, :3] @ point_mm + projection[3, 3])
    magnified = float(np.linalg.norm(projection[1, :3]))
    return 2 * away / (magnified * height_px) if away > 0 and magnified > 0 else float("nan")


def foremost(
    points_mm: Floats, projection: NDArray[np.float64], size_px: tuple[int, int]
) -> NDArray[np.bool_]:
    """Which points (n, 3) are on the screen and not hidden by others, shape (n,).

    The view of ``size_px`` (width, height) is divided into cells that hold a few points each; a point is
    hidden when another one in its cell or next to it is nearer by more than a steep surface would be.
    """
    width, height = size_px
    seen = on_screen(points_mm, projection)
    inside = np.flatnonzero((np.abs(seen[:, :2]) <= 1).all(1) & (np.abs(seen[:, 2]) <= 1))
    found = np.zeros(len(points_mm), bool)
    if inside.size == 0:
        return found
    spread = np.ptp(seen[inside, :2], axis=0)
    area_px = max(float(spread[0] * width * spread[1] * height) / 4, 1.0)
    cell_px = max(2 * (area_px / inside.size) ** 0.5, LEAST_CELL_PX)
    x = ((seen[inside, 0] + 1) * width / 2 / cell_px).astype(np.intp)
    y = ((seen[inside, 1] + 1) * height / 2 / cell_px).astype(np.intp)
    depth = _depth_mm(points_mm[inside], projection)
    # A rim of a cell on all sides, so that each cell has eight neighbours.
    nearest = np.full((int(height / cell_px) + 4, int(width / cell_px) + 4), np.inf)
    np.minimum.at(nearest, (y + 1, x + 1), depth)
    middle = points_mm[inside].mean(0, dtype=np.float64)
    slack_mm = 1.5 * STEEPEST * cell_px * mm_per_px(middle, projection, height)
    front = np.min([nearest[y + down, x + right] for down in range(3) for right in range(3)], axis=0)
    found[inside[depth <= front + slack_mm]] = True
    return found


def _depth_mm(points_mm: Floats, projection: NDArray[np.float64]) -> NDArray[np.float64]:
    """Distance along the view, from any zero."""
    row = projection[3] if np.linalg.norm(projection[3, :3]) > 0 else projection[2]
    return np.asarray((points_mm @ row[:3] + row[3]) / np.linalg.norm(row[:3]))


def scale_bar(length_per_px: float, most_px: float) -> tuple[float, float]:
    """A round length of at most ``most_px`` on the screen, and its size there, px.

    >>> scale_bar(0.31, 120)
    (20.0, 64.51612903225806)
    """
    most = length_per_px * most_px
    decade = 10.0 ** np.floor(np.log10(most))
    length = float(max(step * decade for step in (1, 2, 5) if step * decade <= most))
    return length, length / length_per_px
