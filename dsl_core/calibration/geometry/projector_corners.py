"""Where a camera and a projector see the corners of a board: edges in the picture, Gray code around them.

Moreno and Taubin, "Simple, accurate, and robust projector-camera calibration" (3DIMPVT 2012): a corner is a
point where four squares meet, where no pixel decodes well; but around it, on the plane of the board, the map
from camera to projector pixels is smooth, and many decoded pixels determine it well below one pixel. Here
that map is quadratic, and fitted to the grey values of the code instead of decoded whole numbers.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsl_core.calibration.geometry.boards import Corners, find_corners, grey_of, pitches_px, refine_corners
from dsl_core.calibration.geometry.code_model import MIN_PIXELS, CornerWindow, code_light, refine_maps
from dsl_core.errors import CalibrationError
from dsl_core.model.board import Board, corner_positions_mm
from dsl_core.model.calibration.pose_frames import PoseFrames
from dsl_core.model.plan import GrayCode
from dsl_core.patterns.gray_code import DecodedCode, GrayDecoder, bit_counts, frame_count, lit_mask

Floats = NDArray[np.float64]

#: Share of the corners around which the code must be readable.
MIN_READ = 0.4
#: Pixels within this share of the distance between corners are used for a corner (into all four squares
#: around it), at most so far away, where lenses are still nearly quadratic.
REACH, MIN_REACH_PX, MAX_REACH_PX = 0.8, 4.0, 24.0
#: Residual (projector px) beyond which a pixel is decoded wrongly.
INLIER_PX = 1.5
#: A bit counts when it differs from its inverse by this share of the light on its pixel.
MIN_MARGIN = 0.05
#: Pixels with less light than this share of the brightest ones are in shadow.
MIN_LIGHT = 0.03
#: Share of readable pixels that may decode to places outside the projector.
MAX_OUTSIDE = 0.02


@dataclass(frozen=True)
class PoseObservation:
    """Corners of one pose as both devices see them; arrays have one row a corner.

    ``board_mm`` (x, y, 0) on the board, ``camera_px`` and ``projector_px`` (column, row). ``slope`` (corners,
    2, 2) is how the projector's place changes with the camera's on the board: the code was looked up at
    ``camera_px``, so that an error there enters ``projector_px`` times the slope; None counts as
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
    not found, or when the code cannot be read around its corners.
    """
    check_frames(frames, projector_size_px)
    corners = find_corners(grey_of(frames.white, frames.bayer), board, f"the white picture of {frames.name}")
    corners, blur_px = refine_corners(frames, corners, board)
    code = decode_pose(frames, projector_size_px)
    projector_px, slope = corners_on_projector(code, corners, frames, projector_size_px)
    known = np.isfinite(projector_px[:, 0])
    if known.sum() < max(6, MIN_READ * len(known)):
        raise CalibrationError(
            f"{frames.name}: the board was found ({len(known)} corners), but the projector's code can be"
            f" read around only {known.sum()} of them. {explain(frames, corners, projector_size_px)}"
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


def check_frames(frames: PoseFrames, projector_size_px: tuple[int, int]) -> None:
    """Raise `CalibrationError` when the pictures of a pose are incomplete, of mixed sizes or exchanged."""
    wanted = frame_count(GrayCode(), projector_size_px) - 2
    if len(frames.pairs) != wanted:
        width, height = projector_size_px
        raise CalibrationError(
            f"{frames.name} has {len(frames.pairs)} pattern pictures; a projector of {width} x {height} px"
            f" needs {wanted} (pattern and inverse of every bit). Correct the projector's size or capture the"
            " pose again."
        )
    shapes = {np.shape(picture) for picture in (*frames.pairs, frames.white, frames.black)}
    if len(shapes) > 1:
        raise CalibrationError(
            f"The pictures of {frames.name} differ in size ({', '.join(map(str, sorted(shapes)))})."
            " Take all pictures with one setting of the camera."
        )
    if not all(np.isfinite(np.asarray(p)).all() for p in (*frames.pairs, frames.white, frames.black)):
        raise CalibrationError(
            f"Pictures of {frames.name} contain values that are not finite. Capture them again."
        )
    if np.mean(frames.white) <= np.mean(frames.black):
        raise CalibrationError(
            f"{frames.name}: the white picture is not brighter than the black one. They are swapped, or the"
            " projector was off; correct the order of the pictures."
        )


def decode_pose(frames: PoseFrames, projector_size_px: tuple[int, int]) -> DecodedCode:
    """Projector column and row of every camera pixel; undecided in shadow and where a bit is unclear.

    A mosaic is decoded pixel by pixel, since a pixel is compared with itself only.
    """
    decoder = GrayDecoder(GrayCode(), projector_size_px)
    light = grey_of(frames.white) - grey_of(frames.black)
    bright = float(np.quantile(light, 0.99))
    # Noise of a bit over the light it is made of: the limit is a share, so each pixel has its own scale.
    scale = np.where(lit_mask(light, 0, MIN_LIGHT * bright), light, np.inf)
    for pattern, inverse in zip(frames.pairs[::2], frames.pairs[1::2], strict=True):
        decoder.add(grey_of(pattern), grey_of(inverse), scale)
    return decoder.finish(min_sigmas=MIN_MARGIN)


def check_projector_size(code: DecodedCode, name: str, projector_size_px: tuple[int, int]) -> None:
    """Raise `CalibrationError` when clear bits lead outside the projector: then its size is wrong."""
    assert code.margin_sigmas is not None
    clear = code.margin_sigmas >= MIN_MARGIN
    outside = float((code.undecided & clear).sum() / max(clear.sum(), 1))
    if outside > MAX_OUTSIDE:
        width, height = projector_size_px
        raise CalibrationError(
            f"{name}: {outside:.0%} of the readable pixels decode to places outside a projector of"
            f" {width} x {height} px. Correct its size; width and height may be swapped."
        )


def readable_share(code: DecodedCode, corners: Corners) -> float:
    """Share of the corners around which the code can be read."""
    maps = [decoded_maps(code, window) for window in windows_around(code, corners)]
    return sum(each is not None for each in maps) / max(len(maps), 1)


def windows_around(code: DecodedCode, corners: Corners) -> list[CornerWindow]:
    """The pixels used for each corner."""
    radii = np.clip(REACH * pitches_px(corners.points_px), MIN_REACH_PX, MAX_REACH_PX)
    return [
        CornerWindow.around(point, radius, code.undecided.shape)
        for point, radius in zip(corners.points_px, radii, strict=True)
    ]


def decoded_maps(code: DecodedCode, window: CornerWindow) -> Floats | None:
    """Quadratic maps (2, 6) to column and row through most of the decoded pixels; None for too few."""
    import cv2

    assert code.row is not None
    read = ~code.undecided[window.rows, window.columns]
    near = window.terms[read][:, 1:3]
    if len(near) < MIN_PIXELS or not _surrounds(near):
        return None
    pixels = (window.rows[read], window.columns[read])
    seen = np.stack([code.column[pixels], code.row[pixels]], 1).astype(float)
    homography, used = cv2.findHomography(near, seen, cv2.RANSAC, INLIER_PX)
    if homography is None or used.sum() < max(MIN_PIXELS, 0.5 * len(near)):
        return None
    agree = used.ravel() > 0
    maps, *_ = np.linalg.lstsq(window.terms[read][agree], seen[agree], rcond=None)
    return np.asarray(maps.T)


def _surrounds(near: Floats) -> bool:
    """Whether points are on all sides of the origin, so that nothing is extrapolated."""
    return bool((near.min(0) < 0).all() and (near.max(0) > 0).all())


def explain(frames: PoseFrames, corners: Corners, projector_size_px: tuple[int, int]) -> str:
    """Why a code cannot be read: another order of the pictures that can, or else how they are lit."""
    bits = bit_counts(GrayCode(), projector_size_px)
    for words, pairs in _other_orders(list(frames.pairs), bits[0]):
        code = decode_pose(replace(frames, pairs=pairs), projector_size_px)
        read = readable_share(code, corners)
        if read > 0.8:
            return f"It can be read if {words}: the order of the patterns is wrong. Correct it."
    return (
        "Check that the projector lights the whole board, that its pictures are neither too dark nor"
        " over-exposed, and the order of the patterns (columns first, most significant bit first, each"
        " followed by its inverse)."
    )


def _other_orders(frames: list[NDArray[Any]], column_bits: int) -> list[tuple[str, list[NDArray[Any]]]]:
    """Orders that are easily mistaken for the right one, in words and as reordered pictures."""
    pairs = list(zip(frames[::2], frames[1::2], strict=True))
    half, rows = len(pairs), len(pairs) - column_bits
    orders = {
        "every inverse comes before its pattern": [(b, a) for a, b in pairs],
        "rows come before columns": pairs[rows:] + pairs[:rows],
        "the least significant bit comes first": pairs[:column_bits][::-1] + pairs[column_bits:][::-1],
        "all patterns come before all inverses": list(zip(frames[:half], frames[half:], strict=True)),
    }
    return [(words, [picture for pair in order for picture in pair]) for words, order in orders.items()]
