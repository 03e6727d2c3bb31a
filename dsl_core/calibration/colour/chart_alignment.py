"""Corners of a chart moved until every patch is even."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dsl_core.optics.charts import CHART_SHAPE

Floats = NDArray[np.float64]

#: Half width of the part of a patch that must be even, as a share of the distance between patches; samples
#: along each side of it.
EVEN, SAMPLES = 0.40, 9
#: Largest move of a corner, as a share of the distance between patches.
REACH = 0.3


def align_corners(picture: NDArray[np.uint8], corners_px: Floats) -> Floats:
    """Corners (4, 2) near those given for which the patches of a picture (rows, columns, 3) are most even.

    A detector's corners are some percent of a patch off; seen from a slightly wrong grid, dark lines between
    patches enter their squares, which this pushes out.
    """
    import cv2
    from scipy.optimize import minimize

    points = _sample_points()
    pitch = np.linalg.norm(corners_px[1] - corners_px[0]) / CHART_SHAPE[1]
    image = picture.astype(np.float32)

    def unevenness(shift: Floats) -> float:
        at = grid_to_picture(corners_px + pitch * shift.reshape(4, 2), points).astype(np.float32)
        values = cv2.remap(
            image, at[:, :1], at[:, 1:], cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=0
        )
        patches = np.asarray(values, np.float64).reshape(-1, SAMPLES**2, 3)
        return float(patches.std(1).mean())

    found = minimize(
        unevenness, np.zeros(8), method="Powell", bounds=[(-REACH, REACH)] * 8, options={"xtol": 1e-3}
    )
    return corners_px + pitch * np.asarray(found.x).reshape(4, 2)


def grid_corners() -> Floats:
    """Corners of the grid of patches in units of the distance between patches, (4, 2), clockwise."""
    rows, columns = CHART_SHAPE
    return np.array([[0, 0], [columns, 0], [columns, rows], [0, rows]], float)


def grid_to_picture(corners_px: Floats, points: Floats) -> Floats:
    """Pixels (n, 2) of points of the grid (n, 2) by the homography of the four corners."""
    return apply_homography(homography(grid_corners(), corners_px), points)


def homography(source: Floats, target: Floats) -> Floats:
    """The homography (3, 3) that takes points (n, 2) to others, best in the sense of least squares."""
    import cv2

    found, _ = cv2.findHomography(source, target)
    return np.asarray(found, float)


def apply_homography(matrix: Floats, points: Floats) -> Floats:
    """Points (n, 2) moved by a homography."""
    lifted = np.concatenate([points, np.ones((len(points), 1))], 1) @ matrix.T
    return np.asarray(lifted[:, :2] / lifted[:, 2:])


def _sample_points() -> Floats:
    """Points of the grid inside all patches in reading order, (24 * SAMPLES**2, 2)."""
    rows, columns = CHART_SHAPE
    offsets = np.linspace(-EVEN, EVEN, SAMPLES)
    square = np.stack(np.meshgrid(offsets, offsets), -1).reshape(-1, 2)
    centres = [[i % columns + 0.5, i // columns + 0.5] for i in range(rows * columns)]
    return np.concatenate([square + centre for centre in centres])
