"""A printed board before the twin: its frames under Gray code, and where its corners really are."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from dsl_core.calibration.geometry.projector_corners import PoseObservation
from dsl_core.campaign.geometry.board_poses import BoardPose, outline_mm
from dsl_core.model.board import Checkerboard
from dsl_core.model.calibration.pose_frames import PoseFrames
from dsl_core.model.plan import GrayCode
from dsl_core.optics.pinhole import project
from dsl_core.patterns.gray_code import code_image, frame_count
from dsl_core.simulation.published_rig import published_rig
from dsl_core.simulation.rendered_scene import Setup
from dsl_core.simulation.scenes.catalogue import make_scene
from dsl_core.simulation.world import World

BOARD = Checkerboard(columns=11, rows=7, square_mm=20.0)
PROJECTOR_PX = (640, 360)
#: A pose that is tilted about both axes.
TILTED = {
    "x_mm": 12.0,
    "y_mm": 3.0,
    "depth_mm": 660.0,
    "tilt_x_deg": 18.0,
    "tilt_y_deg": -14.0,
    "roll_deg": 5.0,
}
TILTED_SIZE_PX = (222, 145)


def frames_of(
    pose: Mapping[str, float], size_px: tuple[int, int], seed: int = 0, exposure_ms: float = 8.0
) -> PoseFrames:
    """All pictures of a pose, film off, with noise."""
    rig = published_rig()
    rig = rig.model_copy(update={"camera": rig.camera.resized(*size_px)})
    world = World(Setup(rig, film=False), lambda position_mm: make_scene("board", **pose), seed=seed)
    pictures = []
    for index in range(frame_count(GrayCode(), PROJECTOR_PX)):
        world.show(code_image(GrayCode(), PROJECTOR_PX, index))
        pictures.append(world.expose(exposure_ms, index))
    return PoseFrames("pose", pictures[:-2], pictures[-2], pictures[-1], rig.sensor.bayer)


def true_corners(
    pose: Mapping[str, float], size_px: tuple[int, int]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Where camera and projector see the corners, each (corners, 2)."""
    rig = published_rig()
    outline = outline_mm(BoardPose(**pose), BOARD)
    columns, rows = BOARD.corner_grid
    v, u = (np.mgrid[1 : rows + 1, 1 : columns + 1].reshape(2, -1).T / (rows + 1, columns + 1)).T
    across, down = outline[:, [1]] - outline[:, [0]], outline[:, [3]] - outline[:, [0]]
    points = outline[:, [0]] + u * across + v * down
    there = rig.pose.matrix @ points + rig.pose.vector_mm[:, None]
    camera = project(rig.camera.resized(*size_px), *points)
    return np.stack(camera, 1), np.stack(project(rig.projector, *there), 1)


def tilted_errors(seen: PoseObservation) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Of corners of the tilted pose in the camera, and of the code at the places where it was read."""
    camera, projector = true_corners(TILTED, TILTED_SIZE_PX)
    nearest = np.linalg.norm(camera[:, None] - seen.camera_px, axis=2).argmin(0)
    off = seen.camera_px - camera[nearest]
    return off, seen.projector_px - projector[nearest] - np.einsum("nij,nj->ni", seen.slopes, off)
