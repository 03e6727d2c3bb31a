"""How large the squares of a board are that a rig places itself, where nobody says: as its view asks for."""

from __future__ import annotations

import numpy as np

from dsl_core.campaign.geometry.board_poses import BoardPose, default_poses, outline_mm
from dsl_core.errors import CalibrationError
from dsl_core.model.base import Record
from dsl_core.model.board import Board, Charuco
from dsl_core.model.rig import Rig
from dsl_core.optics.pinhole import project

#: Sides of squares, mm, the largest first.
SIDES_MM = (100.0, 80.0, 60.0, 50.0, 40.0, 30.0, 25.0, 20.0, 15.0, 12.0, 10.0, 8.0, 6.0, 5.0, 4.0, 3.0, 2.0)
#: Share of the picture between the outermost corners that a board has at least in every pose; a little more
#: than its look asks for.
LEAST_SHARE = 0.1


class BoardNote(Record):
    """The board that the pictures of a pose show."""

    board: Board


def fitting_board(board: Board, rig: Rig, count: int) -> Board:
    """The board, or one with other squares where a rig's view is too small or too large for it.

    It is the board itself, too, where no squares fit.
    """
    if _least_share(board, rig, count) >= LEAST_SHARE:
        return board
    sizes = (_of_side(board, side_mm) for side_mm in SIDES_MM)
    return next((each for each in sizes if _least_share(each, rig, count) > 0), board)


def _least_share(board: Board, rig: Rig, count: int) -> float:
    """Share of the picture that it fills at least in so many poses; 0 where not all of it is seen."""
    try:
        poses = default_poses(board, rig, count)
    except CalibrationError:
        return 0.0
    return min(_share(pose, board, rig) for pose in poses)


def _share(pose: BoardPose, board: Board, rig: Rig) -> float:
    """Share of the picture between the outermost corners."""
    x, y = project(rig.camera, *outline_mm(pose, board))
    columns, rows = board.corner_grid
    inner = (columns - 1) * (rows - 1) / ((columns + 1) * (rows + 1))
    area_px2 = 0.5 * abs(float(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1))))
    return inner * area_px2 / (rig.camera.width_px * rig.camera.height_px)


def _of_side(board: Board, side_mm: float) -> Board:
    if isinstance(board, Charuco):
        marker_mm = board.marker_mm * side_mm / board.square_mm
        return board.model_copy(update={"square_mm": side_mm, "marker_mm": marker_mm})
    return board.model_copy(update={"square_mm": side_mm})
