"""How much of its picture a device can cover with corners: no more than the other one sees as well.

A camera on its side, or far to one side, shares a third of the projector's picture, wherever boards are held.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.calibration.geometry import GeometryCalibration
from dsl_core.model.geometry import Lens

#: Cells each way by which pictures are asked what both devices see.
CELLS = 32
#: Share of what both see that corners should cover: boards stay away from its edges.
REACHED = 0.6


def wanted_coverage(found: GeometryCalibration, share: float) -> tuple[float, float]:
    """The least coverage of camera and projector, 0 to 1: ``share``, or less where no board can be seen.

    Both pictures are compared on a plane across the view, at the mean distance of the boards; what lenses
    distort is small against a cell.
    """
    depth = float(np.mean([pose.distance_mm for pose in found.poses if pose.used]))
    matrix, shift = found.pose.matrix, found.pose.vector_mm
    # The plane z = depth of the camera, along the rays of either device.
    camera = _seen(_rays(found.camera) * depth, found.projector, matrix, shift)
    turned, start = matrix.T @ _rays(found.projector), -matrix.T @ shift
    with np.errstate(divide="ignore", invalid="ignore"):
        points = start[:, None] + turned * ((depth - start[2]) / turned[2])
    projector = _seen(points, found.camera, np.eye(3), np.zeros(3))
    if found.columns_only:
        projector = np.asarray(projector.any(0))
    return min(share, REACHED * float(camera.mean())), min(share, REACHED * float(projector.mean()))


def _rays(lens: Lens) -> NDArray[np.float64]:
    """Directions through the middles of all cells, (3, cells), z = 1."""
    places = [(np.arange(CELLS) + 0.5) / CELLS * size - 0.5 for size in (lens.width_px, lens.height_px)]
    columns, rows = (each.ravel() for each in np.meshgrid(*places))
    return np.asarray(np.linalg.inv(lens.matrix) @ np.stack([columns, rows, np.ones_like(columns)]))


def _seen(
    points: NDArray[np.float64], lens: Lens, matrix: NDArray[np.float64], shift: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Which cells (rows, columns) of a picture, at ``points`` (3, cells) mm, a device sees."""
    x, y, z = lens.matrix @ (matrix @ points + shift[:, None])
    with np.errstate(divide="ignore", invalid="ignore"):
        column, row = x / z, y / z
    seen = (column > -0.5) & (column < lens.width_px - 0.5) & (row > -0.5) & (row < lens.height_px - 0.5)
    return np.asarray((seen & (z > 0)).reshape(CELLS, CELLS))
