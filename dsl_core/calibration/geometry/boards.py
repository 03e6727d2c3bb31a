"""Corners of printed boards, found to a fraction of a pixel."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsl_core.calibration.geometry.corner_model import even_mosaic, fit_corners
from dsl_core.errors import CalibrationError
from dsl_core.model.board import Board, Charuco, Checkerboard, corner_positions_mm
from dsl_core.model.calibration.pose_frames import PoseFrames
from dsl_core.model.rig import BayerPattern
from dsl_core.optics.demosaic import demosaic

Floats = NDArray[np.float64]

#: A board with fewer corners in view says too little of its pose.
MIN_CORNERS = 12
#: Pixels above this share of the largest value are saturated.
SATURATED_SHARE = 0.998
#: Edges within this share of the distance between corners refine a corner (less where markers are near).
REACH, ARUCO_REACH, MAX_REACH_PX = 0.35, 0.12, 11
#: Pictures of so many pixels are enlarged as well, in which squares of six pixels and less are found.
ENLARGED_PX = 1 << 20
#: Red, green and blue in the grey picture, as a mosaic samples them.
_GREY = np.array([0.25, 0.5, 0.25], np.float32)
#: Colours of a mosaic are made even over so many squares, of which half are black.
EVEN_SQUARES = 2.0


@dataclass(frozen=True)
class Corners:
    """Corners of a board in a picture: their numbers on the board, and positions (column, row) in px."""

    ids: NDArray[np.int64]
    points_px: NDArray[np.float64]


def grey_of(picture: NDArray[Any], bayer: BayerPattern | None = None) -> NDArray[np.float32]:
    """One value per pixel, shape (rows, columns), from a mono, colour or mosaic picture; unit unchanged."""
    values = np.asarray(picture, np.float32)
    if values.ndim == 3:
        return np.asarray(values.mean(2))
    if bayer is None:
        return values
    return np.tensordot(_GREY, np.asarray(demosaic(values, bayer), np.float32), 1)


def find_corners(grey: NDArray[np.float32], board: Board, name: str) -> Corners:
    """Corners of the board in a linear grey picture, shape (rows, columns).

    Raises `CalibrationError` that calls the picture ``name`` when the board is not found.
    """
    if not np.isfinite(grey).all():
        raise CalibrationError(f"{name} contains values that are not finite. Capture the picture again.")
    eight_bit = _eight_bit(grey)
    found = _charuco(eight_bit, board) if isinstance(board, Charuco) else _checkerboard(eight_bit, board)
    columns, rows = board.corner_grid
    if found is None or len(found.ids) < min(MIN_CORNERS, columns * rows):
        seen = "no corners" if found is None else f"{len(found.ids)} corners"
        raise CalibrationError(
            f"The board of {columns} x {rows} inner corners was not found in {name} ({seen})."
            f"{_exposure_hint(eight_bit, grey)} Check that the whole board is in view, sharp and evenly lit,"
            " and that the numbers of corners are those of the printed board; or leave this pose out."
        )
    return found


def other_board(grey: NDArray[np.float32], board: Board) -> str:
    """Which checkerboard a linear picture shows instead; empty if none nearly as large.

    Squares are often counted in place of corners. The sentence has a space before it, to follow another.
    Takes some seconds for a large picture.
    """
    import cv2

    if isinstance(board, Charuco) or not np.isfinite(grey).all():
        return ""
    picture = _eight_bit(grey)
    columns, rows = board.corner_grid
    # Larger ones first: a part of a board is found as well.
    for more in (1, 0, -1):
        for other in (1, 0, -1):
            size = columns + more, rows + other
            # The same board turned by 90 degrees is no other one.
            if min(size) < 3 or sorted(size) == sorted((columns, rows)):
                continue
            if cv2.findChessboardCornersSB(picture, size, flags=cv2.CALIB_CB_NORMALIZE_IMAGE)[0]:
                return (
                    f" A board of {size[0]} x {size[1]} inner corners is seen instead: count the places where"
                    " four squares meet, not the squares."
                )
    return ""


def _checkerboard(grey: NDArray[np.uint8], board: Checkerboard) -> Corners | None:
    import cv2

    # Duda and Frese (BMVC 2018): finds and refines in one; does not bend at squares of few pixels.
    thorough = cv2.CALIB_CB_ACCURACY | cv2.CALIB_CB_NORMALIZE_IMAGE | cv2.CALIB_CB_EXHAUSTIVE
    # Noise of a dark surrounding, or squares of many or few pixels, hide a board from some attempts.
    attempts = [(1.0, cv2.CALIB_CB_ACCURACY), (0.5, thorough), (1.0, thorough)]
    if grey.size <= ENLARGED_PX:
        attempts.insert(1, (2.0, cv2.CALIB_CB_ACCURACY))
    for scale, flags in attempts:
        how = cv2.INTER_AREA if scale < 1 else cv2.INTER_CUBIC
        picture = grey if scale == 1 else cv2.resize(grey, None, fx=scale, fy=scale, interpolation=how)
        ok, points = cv2.findChessboardCornersSB(picture, board.corner_grid, flags=flags)
        if ok:
            # The corner of the first pixel, at -0.5 px, stays where it is.
            at = (points.reshape(-1, 2) + 0.5) / scale - 0.5
            return Corners(np.arange(len(at)), _refined(grey, at))
    return None


def _charuco(grey: NDArray[np.uint8], board: Charuco) -> Corners | None:
    import cv2

    if not hasattr(cv2.aruco, board.dictionary):
        raise CalibrationError(
            f"OpenCV has no markers {board.dictionary!r}. Use a name like DICT_5X5_100 or DICT_4X4_50."
        )
    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, board.dictionary))
    size = (board.columns, board.rows)
    drawn = cv2.aruco.CharucoBoard(size, float(board.square_mm), float(board.marker_mm), dictionary)
    drawn.setLegacyPattern(board.legacy)
    # The stubs do not know that nothing may be found.
    answer: tuple[Any, ...] = cv2.aruco.CharucoDetector(drawn).detectBoard(grey)
    points, ids = answer[:2]
    if points is None or ids is None:
        return None
    return Corners(np.asarray(ids, np.int64).ravel(), _refined(grey, points, ARUCO_REACH))


def saturated(frames: PoseFrames) -> NDArray[np.bool_]:
    """Pixels whose white is as bright as the camera can tell, shape (rows, columns)."""
    if frames.saturated is not None:
        return frames.saturated
    white = np.asarray(frames.white)
    if np.issubdtype(white.dtype, np.floating):
        return np.zeros(white.shape[:2], bool)
    full = next(2.0**bits - 1 for bits in (8, 10, 12, 14, 16, 64) if np.max(white) < 2**bits)
    full_pixels = white >= SATURATED_SHARE * full
    return np.asarray(full_pixels.any(2) if white.ndim == 3 else full_pixels)


def _refined(grey: NDArray[np.uint8], points: NDArray[Any], reach: float = REACH) -> NDArray[np.float64]:
    """Corners moved to where the edges around them meet, shape (corners, 2).

    Foerstner's operator over all edges in reach averages over more pixels than the detectors do.
    """
    import cv2

    # OpenCV 4 gives (corners, 1, 2), OpenCV 5 (corners, 2).
    start = np.asarray(points, np.float32).reshape(-1, 1, 2).copy()
    pitch = float(np.median(pitches_px(start.reshape(-1, 2))))
    radius = int(np.clip(reach * pitch, 2, MAX_REACH_PX))
    criteria = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_MAX_ITER, 100, 1e-5)
    refined = cv2.cornerSubPix(grey, start, (radius, radius), (-1, -1), criteria)
    return np.asarray(refined, np.float64).reshape(-1, 2)


def pitches_px(points: NDArray[np.floating]) -> NDArray[np.float64]:
    """Distance from each corner to its nearest neighbour, px, shape (corners,)."""
    gaps = np.linalg.norm(points[:, None].astype(np.float64) - points[None], axis=-1)
    np.fill_diagonal(gaps, np.inf)
    return np.asarray(gaps.min(1))


def _eight_bit(grey: NDArray[np.float32]) -> NDArray[np.uint8]:
    """The detectors need bytes; all but the brightest thousandth keep their differences."""
    top = max(float(np.quantile(grey, 0.999)), 1e-12)
    return np.asarray(np.clip(grey * (255 / top), 0, 255).round(), np.uint8)


def _exposure_hint(eight_bit: NDArray[np.uint8], grey: NDArray[np.float32]) -> str:
    if float((grey >= grey.max()).mean()) > 0.2:
        return " A fifth of the picture is equally bright: it is probably over-exposed."
    return " The picture has hardly any contrast." if float(eight_bit.std()) < 5 else ""


def refine_corners(frames: PoseFrames, corners: Corners, board: Board) -> tuple[Corners, float]:
    """Corners at the crossing of the edges around them, and the median blur of these edges, px.

    Corners whose edges cannot be fitted stay where they were.
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
    """Curvature of the edges along board x and y at every corner, (corners, 2), from its neighbours.

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
        raise CalibrationError("The corners of the board are on one line. Leave this pose out.")
    ends = []
    for step in np.array([[0.5, 0.0], [0.0, 0.5]]):
        both = cv2.perspectiveTransform(np.stack([places + step, places - step]), homography)
        ends.append(np.asarray(both, np.float64)[0] - np.asarray(both, np.float64)[1])
    return np.stack(ends, 1)
