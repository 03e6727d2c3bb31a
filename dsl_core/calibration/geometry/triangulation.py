"""Corners in space from two lenses, and how square and flat the board comes out."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dsl_core.calibration.geometry.bundle import CAMERA, PROJECTOR, STEREO, move, project
from dsl_core.calibration.geometry.projector_corners import PoseObservation
from dsl_core.model.board import Board
from dsl_core.model.calibration.geometry import Flatness

Floats = NDArray[np.float64]


def triangulate(shared: Floats, seen: PoseObservation, start_mm: Floats) -> Floats:
    """Points (corners, 3) in camera coordinates, mm, whose images are nearest to those seen, in pixels.

    ``shared`` are the parameters of lenses and pose (see `bundle`). Gauss and Newton from ``start_mm``; the
    board plays no part in where they end.
    """
    points = start_mm
    stereo = np.broadcast_to(shared[STEREO], (len(points), 6))
    for _ in range(10):
        camera, _, camera_slope = project(shared[CAMERA], points)
        in_projector, _ = move(stereo, points)
        projector, _, projector_slope = project(shared[PROJECTOR], in_projector)
        # The rotation between the devices, column by column, is what moving a point by one unit does.
        turn = move(stereo[:3], np.eye(3))[0] - shared[STEREO][3:]
        slope = np.concatenate([camera_slope, projector_slope @ turn.T], 1)
        error = np.concatenate([camera - seen.camera_px, projector - seen.projector_px], 1)
        square = np.swapaxes(slope, 1, 2)
        step = np.linalg.solve(square @ slope, square @ error[:, :, None])[:, :, 0]
        points = points - step
        if np.abs(step).max() < 1e-6 * np.abs(points).max():
            break
    return points


def flatness(points_mm: Floats, ids: NDArray[np.int64], board: Board) -> Flatness:
    """Sides of all squares whose corners were seen, and rms distance from the best plane."""
    sides = _sides(points_mm, ids, board)
    around = points_mm - points_mm.mean(0)
    off_plane = float(np.linalg.svd(around, compute_uv=False)[2] / np.sqrt(len(points_mm)))
    return Flatness(square_mm=float(sides.mean()), square_std_mm=float(sides.std()), plane_rms_mm=off_plane)


def _sides(points_mm: Floats, ids: NDArray[np.int64], board: Board) -> Floats:
    columns, rows = board.corner_grid
    known = np.full((rows * columns, 3), np.nan)
    known[ids] = points_mm
    grid = known.reshape(rows, columns, 3)
    sides = [np.linalg.norm(np.diff(grid, axis=axis), axis=-1).ravel() for axis in (0, 1)]
    joined = np.concatenate(sides)
    return np.asarray(joined[np.isfinite(joined)])
