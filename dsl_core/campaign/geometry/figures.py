"""What a person judges the board by: a look before it is captured, and the fit of all its poses."""

from __future__ import annotations

import numpy as np

from dsl_core.calibration.geometry.boards import find_corners, grey_of, refine_corners
from dsl_core.calibration.geometry.common_view import wanted_coverage
from dsl_core.calibration.geometry.pose_series import GOOD_RMS_PX, MIN_POSES, board_normal
from dsl_core.campaign.common.recipe import Found
from dsl_core.campaign.common.white_shot import WhiteLevel, other_light
from dsl_core.model.board import Board, corner_positions_mm
from dsl_core.model.calibration.geometry import GeometryCalibration
from dsl_core.model.calibration.pose_frames import PoseFrames
from dsl_core.model.figure import Figure, doubts
from dsl_core.model.rig import Rig
from dsl_core.optics.parallax import parallax_at

#: A board of fewer corners than this share in view says too little.
LEAST_CORNERS = 0.6
#: Edges blurred by more (standard deviation, px) are out of focus or moved.
MOST_BLUR_PX = 1.5
#: Least share of the view between the outermost corners, %.
LEAST_VIEW = 8.0
#: Limits of a good calibration; that of the reprojection is the calibration's own.
PLANE_SHARE, SQUARE_SHARE, COVERAGE = 5e-4, 0.005, 0.35

#: A column may stand for so many times the usual most of depth: with more, no later calibration succeeds.
NO_DEPTH = 4.0


def look_at_board(white: WhiteLevel, board: Board, rig: Rig, title: str, found: Found) -> tuple[Figure, ...]:
    """Figures of a white picture of a board; raises `CalibrationError` when the board is not found.

    ``found`` is told where its corners are.
    """
    import cv2

    picture = np.asarray(white.picture, np.float32)
    what = f"the test shot of {title}"
    corners = find_corners(grey_of(picture, rig.sensor.bayer), board, what)
    frames = PoseFrames(what, [], picture, np.zeros_like(picture), rig.sensor.bayer)
    corners, blur_px = refine_corners(frames, corners, board)
    found(corners.points_px)
    hull = cv2.convexHull(corners.points_px.astype(np.float32))
    view = 100 * float(cv2.contourArea(hull)) / picture.size
    normal = board_normal(corner_positions_mm(board)[corners.ids], corners.points_px, rig.camera.matrix, what)
    total = int(np.prod(board.corner_grid))
    # Nobody judges by how many pictures are not saturated.
    saturated = Figure(
        name="white pictures saturated",
        value=1.0,
        unit="",
        high=0.0,
        advice="Close the aperture or dim the projector: its darkest white is too bright.",
    )
    return (
        Figure(
            name="corners found",
            value=len(corners.ids),
            unit="",
            low=np.ceil(LEAST_CORNERS * total),
            advice="Move the board until all of it is in view and lit.",
        ),
        Figure(
            name="share of the picture within the corners",
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
        *((saturated,) if white.saturated else ()),
        other_light(white),
        Figure(name="tilt", value=float(np.degrees(np.arccos(min(abs(normal[2]), 1.0)))), unit="°"),
    )


def geometry_figures(record: GeometryCalibration) -> tuple[Figure, ...]:
    """Key figures of a geometric calibration."""
    squares, board = record.squares, record.board
    left_out = [pose.left_out.square_mm for pose in record.poses if pose.left_out]
    unseen = max((abs(side / board.square_mm - 1) for side in left_out), default=0.0)
    used = sum(pose.used for pose in record.poses)
    more = "Add poses that fill the picture, tilted in all directions, sharp and evenly lit."
    return (
        Figure(name="camera error", value=record.camera_rms_px, unit="px", high=GOOD_RMS_PX, advice=more),
        Figure(
            name="projector error", value=record.projector_rms_px, unit="px", high=GOOD_RMS_PX, advice=more
        ),
        Figure(name="poses used", value=used, unit="", low=MIN_POSES, advice=more),
        Figure(
            name="side of a square",
            value=squares.square_mm,
            std=squares.square_std_mm,
            unit="mm",
            low=board.square_mm * (1 - SQUARE_SHARE),
            high=board.square_mm * (1 + SQUARE_SHARE),
            advice="Measure the printed squares again.",
        ),
        Figure(
            name="side of a square without one pose, largest change",
            value=100 * unseen,
            unit="%",
            high=100 * SQUARE_SHARE,
            advice=more,
        ),
        Figure(
            name="flatness of the board, rms of its bow",
            value=100 * record.shape_rms_share,
            unit="% of their distance",
            high=100 * PLANE_SHARE,
            advice="Use a flat, stiff board, and keep it still.",
        ),
        Figure(
            name="picture covered, camera",
            value=100 * record.camera_coverage,
            unit="%",
            low=100 * wanted_coverage(record, COVERAGE)[0],
            advice=more,
        ),
        Figure(name="picture covered, projector", value=100 * record.projector_coverage, unit="%"),
        _depth_of_columns(record),
        doubts("doubts about poses and print", record.warnings, " "),
    )


def _depth_of_columns(record: GeometryCalibration) -> Figure:
    """Whether columns tell depth; without it the Spectralon seems to bulge, and its place is lost."""
    distance_mm = float(np.median([pose.distance_mm for pose in record.poses]))
    found = parallax_at(record.camera, record.projector, record.pose, distance_mm)
    return Figure(
        name="depth that a column stands for",
        value=found.mm_per_column,
        unit="mm",
        high=NO_DEPTH * found.most_mm,
        advice=f"{found.sentence} {found.advice}" if found.is_small else "",
    )
