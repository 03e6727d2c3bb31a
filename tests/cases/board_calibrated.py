"""A rig whose geometry is known as a board calibration knows it: with its errors, and their covariance."""

from __future__ import annotations

import numpy as np

from dsl_core.calibration.geometry.bundle import CAMERA, PROJECTOR, SHARED, STEREO, adjust, rotation_of
from dsl_core.calibration.geometry.projector_corners import PoseObservation
from dsl_core.calibration.geometry.solve import initial, lens_of, pose_of
from dsl_core.model.board import Checkerboard, corner_positions_mm
from dsl_core.model.rig import Rig
from dsl_core.optics.pinhole import project

BOARD = Checkerboard(columns=12, rows=9, square_mm=22.0)
#: Tilts (rad) and places (mm, from the axis and along it) of the board.
TILTS = ((0.0, 0.0), (0.4, 0.0), (-0.4, 0.1), (0.1, 0.4), (0.0, -0.4), (0.3, 0.3), (-0.3, 0.3), (0.3, -0.3))
PLACES = (
    (0, 0, 700),
    (30, 10, 620),
    (-30, 0, 660),
    (20, -20, 800),
    (-20, 20, 850),
    (0, 10, 740),
    (40, 0, 880),
)


def board_calibrated(truth: Rig, start: Rig, seed: int = 0, noise_px: float = 0.05) -> Rig:
    """``start`` with lenses, pose and covariance found from noisy corners of a board seen by ``truth``.

    The noise is that of an image 890 px wide.
    """
    rng = np.random.default_rng(seed)
    noise = noise_px * truth.camera.width_px / 890
    corners = corner_positions_mm(BOARD)
    poses = []
    for index in range(12):
        tilt, place = TILTS[index % len(TILTS)], PLACES[index % len(PLACES)]
        turn = rotation_of(np.array([*tilt, 0.3 * (index % 3 - 1)]))
        points = (corners - corners.mean(0)) @ turn.T + np.array(place, float)
        camera = np.stack(project(truth.camera, *points.T), 1)
        there = points @ truth.pose.matrix.T + truth.pose.vector_mm
        projector = np.stack(project(truth.projector, *there.T), 1)
        seen = PoseObservation(
            f"pose_{index}",
            np.arange(len(corners)),
            corners,
            camera + rng.normal(0, noise, camera.shape),
            projector + rng.normal(0, noise_px, projector.shape),
        )
        lens, light = truth.camera, truth.projector
        inside = (camera > 0).all(1) & (camera[:, 0] < lens.width_px) & (camera[:, 1] < lens.height_px)
        inside &= (projector > 0).all(1) & (projector < [light.width_px, light.height_px]).all(1)
        poses.append(seen.only(inside))
    sizes = [(lens.width_px, lens.height_px) for lens in (truth.camera, truth.projector)]
    # The joint fit alone: what poses say of each other when they are left out in turn is not needed here.
    found = adjust(poses, initial(poses, sizes[0], sizes[1]))
    return start.model_copy(
        update={
            "camera": lens_of(found.parameters[CAMERA], sizes[0]),
            "projector": lens_of(found.parameters[PROJECTOR], sizes[1]),
            "pose": pose_of(found.parameters[STEREO]),
            "geometry_covariance": tuple(found.covariance[:SHARED, :SHARED].ravel().tolist()),
        }
    )
