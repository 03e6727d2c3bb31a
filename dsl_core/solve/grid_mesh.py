"""Triangles between neighbouring pixels of a depth map, cut where the surface is not continuous.

As organised point clouds are meshed elsewhere (D. Holz and S. Behnke, "Fast Range Image Segmentation and
Smoothing Using Approximate Surface Reconstruction and Region Growing", IAS 2012): the squares of the pixel
grid are split along the better diagonal. Two neighbours are joined unless the step along the ray between
them is more than noise and than any surface that could have been seen.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float32] | NDArray[np.float64]
Mask = NDArray[np.bool_]

#: Tangent of the steepest surface that is joined, seen from the camera: 78 degrees from facing it.
STEEPEST = 4.7
#: A step counts when it is this many deviations, and in any case at this share of the distance.
STEP_SIGMAS, STEP_SHARE = 5.0, 0.01
#: Between two pixels at a depth edge a step of this share of the distance is a jump; as in `surface`.
JUMP_SHARE = 0.004


@dataclass(frozen=True)
class GridMesh:
    """Triangles (n, 3) of vertices, and the flat index of the pixel of each vertex (vertices,).

    Counter-clockwise as the camera sees them: with z away from the camera and y down, normals point to it.
    """

    pixels: NDArray[np.int64]
    triangles: NDArray[np.int32]


def mesh_of_grid(
    points_mm: Floats, std_mm: Floats | None = None, edge: Mask | None = None, every: int = 1
) -> GridMesh:
    """Mesh of points (3, rows, columns) in camera coordinates, NaN where there is none.

    ``std_mm`` is the deviation of depth, ``edge`` marks pixels next to a depth jump, both (rows, columns).
    Of rows and columns only each ``every``-th is used.
    """
    rows, columns = points_mm.shape[1:]
    points = np.asarray(points_mm[:, ::every, ::every], np.float64)
    std = None if std_mm is None else np.nan_to_num(np.asarray(std_mm[::every, ::every], np.float64))
    links = _Links(points, std, None if edge is None else _thinned(edge, every))
    flat = np.arange(rows * columns).reshape(rows, columns)[::every, ::every]
    corners = flat[:-1, :-1], flat[:-1, 1:], flat[1:, :-1], flat[1:, 1:]
    a, b, c, d = corners
    top, bottom = links.joined((0, 0), (0, 1)), links.joined((1, 0), (1, 1))
    left, right = links.joined((0, 0), (1, 0)), links.joined((0, 1), (1, 1))
    falling, rising = links.joined((0, 0), (1, 1)), links.joined((0, 1), (1, 0))
    first = left & bottom & falling, top & right & falling
    second = left & top & rising, right & bottom & rising
    count_first, count_second = (sum(each.astype(np.int8) for each in pair) for pair in (first, second))
    flatter = links.step((0, 0), (1, 1)) <= links.step((0, 1), (1, 0))
    is_first = (count_first > count_second) | ((count_first == count_second) & flatter)
    # No reader needs an order, but neighbours in memory are drawn faster.
    found = [
        np.stack([each[mask] for each in three], axis=1)
        for mask, three in (
            (first[0] & is_first, (a, c, d)),
            (first[1] & is_first, (a, d, b)),
            (second[0] & ~is_first, (a, c, b)),
            (second[1] & ~is_first, (b, c, d)),
        )
    ]
    pixels, triangles = np.unique(np.concatenate(found), return_inverse=True)
    return GridMesh(pixels, triangles.reshape(-1, 3).astype(np.int32))


def _thinned(edge: Mask, every: int) -> Mask:
    """Whether there is an edge in the pixels that a kept one stands for."""
    if every == 1:
        return edge
    from scipy.ndimage import maximum_filter

    return np.asarray(maximum_filter(edge, size=2 * (every // 2) + 1)[::every, ::every], bool)


class _Links:
    """Which pixels of a grid are joined with a neighbour; a corner of a square is (down, right)."""

    def __init__(self, points: NDArray[np.float64], std: Floats | None, edge: Mask | None) -> None:
        self._points, self._std, self._edge = points, std, edge

    def _at(self, values: NDArray[Any], corner: tuple[int, int]) -> NDArray[Any]:
        rows, columns = values.shape[-2:]
        down, right = corner
        return values[..., down : rows - 1 + down, right : columns - 1 + right]

    def step(self, one: tuple[int, int], other: tuple[int, int]) -> NDArray[np.float64]:
        """Difference in depth, infinite where a point is missing, mm."""
        step = np.abs(self._at(self._points[2], one) - self._at(self._points[2], other))
        return np.asarray(np.nan_to_num(step, nan=np.inf))

    def joined(self, one: tuple[int, int], other: tuple[int, int]) -> Mask:
        """Whether a surface continues from one corner of each square to another one."""
        std = None if self._std is None else np.hypot(self._at(self._std, one), self._at(self._std, other))
        edge = None if self._edge is None else self._at(self._edge, one) & self._at(self._edge, other)
        return are_joined(self._at(self._points, one), self._at(self._points, other), std, edge)


def are_joined(
    one_mm: Floats, other_mm: Floats, step_std_mm: Floats | None = None, edge: Mask | None = None
) -> Mask:
    """Whether a surface continues between neighbours (3, ...) in camera coordinates; not to where none is.

    ``step_std_mm`` (...) is the deviation of the step in depth between them, ``edge`` marks jumps of depth.
    """
    between, middle = other_mm - one_mm, (one_mm + other_mm) / 2
    distance = np.sqrt((middle**2).sum(0))
    along = np.abs((between * middle).sum(0) / distance)
    across = np.sqrt(np.maximum((between**2).sum(0) - along**2, 0))
    noise = np.zeros_like(along) if step_std_mm is None else STEP_SIGMAS * step_std_mm
    is_cut = (along > STEEPEST * across) & (along > np.minimum(noise, STEP_SHARE * distance))
    if edge is not None:
        is_cut |= edge & (along > np.maximum(noise, JUMP_SHARE * distance))
    return np.asarray(np.isfinite(along) & ~is_cut)


def normals_of(points_mm: Floats, triangles: NDArray[np.int32]) -> NDArray[np.float32]:
    """Unit normals (n, 3) of vertices (n, 3): means over their triangles, weighted by area."""
    a, b, c = (np.asarray(points_mm, np.float64)[triangles[:, corner]] for corner in range(3))
    areas = np.cross(b - a, c - a)
    at = triangles.ravel()
    normals = np.stack(
        [np.bincount(at, np.repeat(areas[:, axis], 3), len(points_mm)) for axis in range(3)], axis=1
    )
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    return np.asarray(normals / np.where(length > 0, length, 1), np.float32)
