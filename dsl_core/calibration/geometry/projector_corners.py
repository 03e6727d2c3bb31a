"""Where a camera and a projector see the corners of a board: edges in the picture, Gray code around them.

Moreno and Taubin, "Simple, accurate, and robust projector-camera calibration" (3DIMPVT 2012): a corner is a
point where four squares meet, where no pixel decodes well; but around it, on the plane of the board, the map
from camera to projector pixels is smooth, and many decoded pixels determine it well below one pixel. Here
that map is quadratic, and fitted to the grey values of the code instead of decoded whole numbers.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsl_core.calibration.geometry.board_code import (
    check_frames,
    check_projector_size,
    decode_pose,
    decoded_maps,
    explain,
    windows_around,
)
from dsl_core.calibration.geometry.boards import Corners, find_corners, grey_of, saturated
from dsl_core.calibration.geometry.code_model import code_light, refine_maps
from dsl_core.calibration.geometry.corner_model import even_mosaic, fit_corners
from dsl_core.errors import CalibrationError
from dsl_core.model.board import Board, Charuco, corner_positions_mm
from dsl_core.model.calibration.pose_frames import PoseFrames
from dsl_core.patterns.gray_code import DecodedCode

Floats = NDArray[np.float64]

#: Colours of a mosaic are made even over so many squares, of which half are black.
EVEN_SQUARES = 2.0
#: Share of the corners around which the code must be readable.
MIN_READ = 0.4


@dataclass(frozen=True)
class PoseObservation:
    """Corners of one pose as both devices see them; arrays have one row a corner.

    ``board_mm`` (x, y, 0) on the board, ``camera_px`` and ``projector_px`` (column, row). ``slope`` (corners,
    2, 2) is how the projector's place changes with the camera's on the board: the code was looked up at
    ``camera_px``, so that an error there comes back in ``projector_px``, times the slope; None counts as
    zero. ``blur_px`` is that of the edges in the camera's picture (deviation, median of the corners).
    """

    name: str
    ids: NDArray[np.int64]
    board_mm: Floats
    camera_px: Floats
    projector_px: Floats
    slope: Floats | None = None
    blur_px: float = 0.0

    def only(self, keep: NDArray[np.bool_]) -> PoseObservation:
        """The corners where ``keep`` is true."""
        slope = None if self.slope is None else self.slope[keep]
        chosen = (self.ids[keep], self.board_mm[keep], self.camera_px[keep], self.projector_px[keep])
        return PoseObservation(self.name, *chosen, slope, self.blur_px)

    @property
    def slopes(self) -> Floats:
        """`slope`, zero where it is not known, shape (corners, 2, 2)."""
        return np.zeros((len(self.ids), 2, 2)) if self.slope is None else self.slope


def observe_pose(frames: PoseFrames, board: Board, projector_size_px: tuple[int, int]) -> PoseObservation:
    """Corners of the board in camera and projector pixels; without those around which too little decodes.

    Raises `CalibrationError` naming the pose when pictures are missing or differ in size, when the board is
    not found, or when the code says nothing around its corners.
    """
    check_frames(frames, projector_size_px)
    corners = find_corners(grey_of(frames.white, frames.bayer), board, f"the white picture of {frames.name}")
    corners, blur_px = refine_corners(frames, corners, board)
    code = decode_pose(frames, projector_size_px)
    projector_px, slope = corners_on_projector(code, corners, frames, projector_size_px)
    known = np.isfinite(projector_px[:, 0])
    if known.sum() < max(6, MIN_READ * len(known)):
        raise CalibrationError(
            f"{frames.name}: the board was found ({len(known)} corners), but the projector's code can be read"
            f" around {known.sum()} of them only. {explain(frames, corners, projector_size_px)}"
        )
    check_projector_size(code, frames.name, projector_size_px)
    seen = PoseObservation(
        frames.name,
        corners.ids,
        corner_positions_mm(board)[corners.ids],
        corners.points_px,
        projector_px,
        slope,
        blur_px,
    )
    return seen.only(known)


def refine_corners(frames: PoseFrames, corners: Corners, board: Board) -> tuple[Corners, float]:
    """Corners at the crossing of the edges around them, and the median blur of these edges, px.

    Corners whose edges cannot be told stay where they were.
    """
    along = _steps_px(corners, board)
    light = _full_light(frames)
    if frames.bayer is not None:
        light = even_mosaic(light, frames.bayer, EVEN_SQUARES * float(np.linalg.norm(along, axis=2).mean()))
    grey = grey_of(light)
    grey[saturated(frames)] = np.nan
    gap = 0.5 * (1 - board.marker_mm / board.square_mm) if isinstance(board, Charuco) else 1.0
    straight = fit_corners(grey, corners.points_px, along, gap)
    points = np.where(np.isfinite(straight.points_px), straight.points_px, corners.points_px)
    # A lens bends edges by some hundredths of a pixel, which would draw every corner towards its axis.
    found = fit_corners(grey, points, along, gap, _bends_per_px(Corners(corners.ids, points), board))
    points = np.where(np.isfinite(found.points_px), found.points_px, points)
    return Corners(corners.ids, points), float(np.median(found.blur_px))


def _full_light(frames: PoseFrames) -> NDArray[np.float32]:
    """The board in white light, from all pictures: pattern and inverse add up to it, with less noise."""
    total = np.array(frames.white, np.float32)
    for picture in frames.pairs:
        total += picture
    pairs = len(frames.pairs) // 2
    return np.asarray(
        total / (pairs + 1) - np.asarray(frames.black, np.float32) * ((2 * pairs + 1) / (pairs + 1))
    )


def _bends_per_px(corners: Corners, board: Board) -> Floats:
    """Curvature of the edges along board x and y at every corner, (corners, 2), from corners beside it.

    Straight lines stay straight in any perspective, so that what bends them is the lens. Corners without
    neighbours on both sides take what the nearest other has.
    """
    places = np.rint(corner_positions_mm(board)[corners.ids, :2] / board.square_mm).astype(int)
    index = {tuple(place): number for number, place in enumerate(places.tolist())}
    bends = np.full((len(places), 2), np.nan)
    for number, (x, y) in enumerate(places.tolist()):
        for axis, (dx, dy) in enumerate(((1, 0), (0, 1))):
            before, after = index.get((x - dx, y - dy)), index.get((x + dx, y + dy))
            if before is not None and after is not None:
                a, b, c = corners.points_px[[before, number, after]]
                along, bent = (c - a) / 2, a - 2 * b + c
                bends[number, axis] = (along[0] * bent[1] - along[1] * bent[0]) / np.linalg.norm(along) ** 3
    return _nearest_known(places, bends, np.isfinite(bends))


def _nearest_known(places: NDArray[np.int_], values: Floats, known: NDArray[np.bool_]) -> Floats:
    """Values (corners, 2) with those that are not known taken from the nearest corner, or zero."""
    filled = np.where(known, values, 0.0)
    for axis in range(2):
        have, lack = (np.flatnonzero(which[:, axis]) for which in (known, ~known))
        if len(have) and len(lack):
            apart = ((places[lack, None] - places[None, have]) ** 2).sum(2)
            filled[lack, axis] = values[have[apart.argmin(1)], axis]
    return filled


def _steps_px(corners: Corners, board: Board) -> Floats:
    """One square's step along board x and y at every corner, shape (corners, 2, 2), px."""
    import cv2

    places = corner_positions_mm(board)[corners.ids, :2] / board.square_mm
    homography, _ = cv2.findHomography(places, corners.points_px, cv2.RANSAC, 3.0)
    if homography is None:
        raise CalibrationError("The corners of the board lie on one line. Leave this pose out.")
    ends = []
    for step in np.array([[0.5, 0.0], [0.0, 0.5]]):
        both = cv2.perspectiveTransform(np.stack([places + step, places - step]), homography)
        ends.append(np.asarray(both, np.float64)[0] - np.asarray(both, np.float64)[1])
    return np.stack(ends, 1)


def corners_on_projector(
    code: DecodedCode, corners: Corners, frames: PoseFrames, projector_size_px: tuple[int, int]
) -> tuple[Floats, Floats]:
    """Column and row (px) of every corner on the projector, (corners, 2), and their slopes (corners, 2, 2).

    NaN where too few pixels decode; see `PoseObservation` for the slopes.
    """
    windows = windows_around(code, corners)
    starts = [decoded_maps(code, window) for window in windows]
    known = [k for k, start in enumerate(starts) if start is not None]
    places, slopes = np.full((len(windows), 2), np.nan), np.zeros((len(windows), 2, 2))
    if not known:
        return places, slopes
    chosen = [windows[k] for k in known]
    for axis, light in enumerate(code_light(frames, projector_size_px)):
        maps = refine_maps(light, chosen, np.array([start[axis] for start in starts if start is not None]))
        places[known, axis] = maps[:, 0]
        slopes[known, axis] = maps[:, 1:3] / np.array([each.radius_px for each in chosen])[:, None]
    return places, slopes
