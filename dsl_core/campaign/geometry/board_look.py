"""A look at a board before it is captured: found, whole, sharp, not over-exposed, and how it stands."""

from __future__ import annotations

import numpy as np

from dsl_core.calibration.geometry.boards import find_corners, grey_of, refine_corners
from dsl_core.calibration.geometry.pose_series import board_normal
from dsl_core.campaign.common.exposures import WhiteLevel
from dsl_core.campaign.common.light_look import other_light
from dsl_core.model.board import Board, corner_positions_mm
from dsl_core.model.calibration.pose_frames import PoseFrames
from dsl_core.model.figure import Figure
from dsl_core.model.rig import Rig

#: A board of fewer corners than this share in view says too little.
LEAST_CORNERS = 0.6
#: Edges blurred by more (standard deviation, px) are out of focus or moved.
MOST_BLUR_PX = 1.5
#: Least share of the view between the outermost corners, %.
LEAST_VIEW = 8.0


def look_at_board(white: WhiteLevel, board: Board, rig: Rig, title: str) -> tuple[Figure, ...]:
    """Figures of a white picture of a board; raises `CalibrationError` when the board is not found."""
    import cv2

    picture = np.asarray(white.picture, np.float32)
    what = f"the test shot of {title}"
    corners = find_corners(grey_of(picture, rig.sensor.bayer), board, what)
    frames = PoseFrames(what, [], picture, np.zeros_like(picture), rig.sensor.bayer)
    corners, blur_px = refine_corners(frames, corners, board)
    hull = cv2.convexHull(corners.points_px.astype(np.float32))
    view = 100 * float(cv2.contourArea(hull)) / picture.size
    normal = board_normal(corner_positions_mm(board)[corners.ids], corners.points_px, rig.camera.matrix, what)
    total = int(np.prod(board.corner_grid))
    return (
        Figure(
            name="corners found",
            value=len(corners.ids),
            unit="",
            low=LEAST_CORNERS * total,
            high=total,
            advice="Move the board until all of it is in view and lit.",
        ),
        Figure(
            name="view between the corners",
            value=view,
            unit="%",
            low=LEAST_VIEW,
            advice="Hold the board closer, or print a larger one.",
        ),
        Figure(
            name="blur of edges",
            value=blur_px,
            unit="px",
            high=MOST_BLUR_PX,
            advice="Focus the camera and hold the board still.",
        ),
        Figure(
            name="white pictures saturated",
            value=float(white.saturated),
            unit="",
            high=0.0,
            advice="Close the aperture or dim the projector: its darkest white is too bright.",
        ),
        other_light(white),
        Figure(name="tilt", value=float(np.degrees(np.arccos(min(abs(normal[2]), 1.0)))), unit="°"),
    )
