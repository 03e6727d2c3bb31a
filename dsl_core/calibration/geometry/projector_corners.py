"""Where a camera and a projector see the corners of a board: edges in the picture, Gray code around them.

Moreno and Taubin, "Simple, accurate, and robust projector-camera calibration" (3DIMPVT 2012): a corner is a
point where four squares meet, where no pixel decodes well; but around it, on the plane of the board, the map
from camera to projector pixels is smooth, and many decoded pixels determine it well below one pixel. Here
that map is quadratic, and fitted to the grey values of the code instead of decoded whole numbers. Codes of
columns alone give the columns of the corners; codes other than Gray come decoded.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsl_core.calibration.geometry.boards import Corners, find_corners, grey_of, pitches_px, refine_corners
from dsl_core.calibration.geometry.code_model import (
    MIN_PIXELS,
    CornerWindow,
    code_light,
    gray_code_of,
    refine_maps,
)
from dsl_core.calibration.geometry.code_places import CodePlaces, code_places
from dsl_core.errors import CalibrationError
from dsl_core.model.board import Board, corner_positions_mm
from dsl_core.model.calibration.pose_frames import PoseFrames
from dsl_core.model.plan import GrayCode
from dsl_core.patterns.gray_code import bit_counts

Floats = NDArray[np.float64]

#: Share of the corners around which the code must be readable.
MIN_READ = 0.4
#: Pixels within this share of the distance between corners are used for a corner (into all four squares
#: around it), at most so far away, where lenses are still nearly quadratic.
REACH, MIN_REACH_PX, MAX_REACH_PX = 0.8, 4.0, 24.0
#: Residual (projector px) beyond which a pixel is decoded wrongly, or in deviations of coarse codes.
INLIER_PX, INLIER_SIGMAS = 1.5, 3.0
#: Steps of the fit by least absolute residuals, which wrong pixels do not draw.
ROBUST_ROUNDS = 10
#: Share of readable pixels that may decode to places outside the projector.
MAX_OUTSIDE = 0.02


@dataclass(frozen=True)
class PoseObservation:
    """Corners of one pose as both devices see them; arrays have one row a corner.

    ``board_mm`` (x, y, 0) on the board, ``camera_px`` and ``projector_px`` (column, row; all rows are NaN
    where only columns are coded). ``slope`` (corners,
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
    def columns_only(self) -> bool:
        """Whether the code does not say which row of the projector lights a corner."""
        columns, rows = self.projector_px.T
        return bool(np.isfinite(columns).all() and np.isnan(rows).all())

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
    code = code_places(frames, projector_size_px) if frames.places_px is None else None
    projector_px, slope = corners_on_projector(frames, corners, projector_size_px, code)
    known = np.isfinite(projector_px[:, 0])
    if known.sum() < max(6, MIN_READ * len(known)):
        raise CalibrationError(
            f"{frames.name}: the board was found ({len(known)} corners), but the projector's code can be"
            f" read around only {known.sum()} of them. {explain(frames, corners, projector_size_px)}"
        )
    if code is not None:
        check_projector_size(code.outside, frames.name, projector_size_px)
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
    frames: PoseFrames, corners: Corners, projector_size_px: tuple[int, int], code: CodePlaces | None
) -> tuple[Floats, Floats]:
    """Column and row (px) of every corner on the projector, (corners, 2), and their slopes (corners, 2, 2).

    ``code`` is what the pictures decode to; None where they come decoded. NaN where too few pixels decode,
    and for rows that are not coded; see `PoseObservation` for the slopes.
    """
    places_px, std_px = (frames.places_px, frames.places_std_px) if code is None else (code.px, code.std_px)
    assert places_px is not None
    windows = windows_around(places_px[0].shape, corners)
    starts = [decoded_maps(places_px, window, std_px) for window in windows]
    known = [k for k, start in enumerate(starts) if start is not None]
    found, slopes = np.full((len(windows), 2), np.nan), np.zeros((len(windows), 2, 2))
    if not known:
        return found, slopes
    chosen = [windows[k] for k in known]
    by_axis = np.stack([start for start in starts if start is not None], 1)
    if code is not None:
        # Grey values of pictures tell more than their digits.
        lights = code_light(frames, projector_size_px)
        by_axis = np.stack(
            [refine_maps(light, chosen, maps) for light, maps in zip(lights, by_axis, strict=True)]
        )
    for axis, maps in enumerate(by_axis):
        found[known, axis] = maps[:, 0]
        slopes[known, axis] = maps[:, 1:3] / np.array([each.radius_px for each in chosen])[:, None]
    return found, slopes


def check_frames(frames: PoseFrames, projector_size_px: tuple[int, int]) -> None:
    """Raise `CalibrationError` when the pictures of a pose are incomplete, of mixed sizes or exchanged."""
    width, height = projector_size_px
    columns, rows = bit_counts(GrayCode(), projector_size_px)
    decoded = frames.places_px is not None
    if not decoded and len(frames.pairs) not in (2 * columns, 2 * (columns + rows)):
        raise CalibrationError(
            f"{frames.name} has {len(frames.pairs)} pattern pictures; a projector of {width} x {height} px"
            f" needs {2 * (columns + rows)} (pattern and inverse of every bit), or {2 * columns} for columns"
            " alone. Correct the projector's size or capture the pose again."
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


def check_projector_size(outside: float, name: str, projector_size_px: tuple[int, int]) -> None:
    """Raise `CalibrationError` when clear bits lead outside the projector: then its size is wrong."""
    if outside > MAX_OUTSIDE:
        width, height = projector_size_px
        raise CalibrationError(
            f"{name}: {outside:.0%} of the readable pixels decode to places outside a projector of"
            f" {width} x {height} px. Correct its size; width and height may be swapped."
        )


def readable_share(code: CodePlaces, corners: Corners) -> float:
    """Share of the corners around which the code can be read."""
    windows = windows_around(code.px.shape[1:], corners)
    maps = [decoded_maps(code.px, window, code.std_px) for window in windows]
    return sum(each is not None for each in maps) / max(len(maps), 1)


def windows_around(shape: tuple[int, ...], corners: Corners) -> list[CornerWindow]:
    """The pixels used for each corner of a picture of a shape."""
    radii = np.clip(REACH * pitches_px(corners.points_px), MIN_REACH_PX, MAX_REACH_PX)
    return [
        CornerWindow.around(point, radius, shape)
        for point, radius in zip(corners.points_px, radii, strict=True)
    ]


def decoded_maps(
    places_px: NDArray[np.floating], window: CornerWindow, std_px: NDArray[np.floating] | None = None
) -> Floats | None:
    """Quadratic maps (axes, 6) to column and row through most of the decoded pixels; None for too few.

    Pixels weigh by their deviations ``std_px``, of the shape of ``places_px`` (axes, rows, columns).
    """
    seen = places_px[:, window.rows, window.columns].astype(float)
    read = np.isfinite(seen).all(0)
    terms = window.terms[read]
    if len(terms) < MIN_PIXELS or not _surrounds(terms[:, 1:3]):
        return None
    stds = np.ones_like(seen) if std_px is None else std_px[:, window.rows, window.columns].astype(float)
    limits = np.full_like(seen, INLIER_PX) if std_px is None else np.maximum(INLIER_PX, INLIER_SIGMAS * stds)
    maps = [
        _map_of_most(terms, values, std, limit)
        for values, std, limit in zip(seen[:, read], stds[:, read], limits[:, read], strict=True)
    ]
    return None if any(each is None for each in maps) else np.array(maps)


def _map_of_most(terms: Floats, values: Floats, std: Floats, limit: Floats) -> Floats | None:
    """The quadratic map (6,) from which most values are off by less than a limit; None if most are not."""
    agree = off_most(terms, values, limit) < limit
    if agree.sum() < max(MIN_PIXELS, 0.5 * len(values)):
        return None
    return _weighted_map(terms, values, agree / std**2)


def off_most(terms: Floats, values: Floats, limit: Floats | float = INLIER_PX) -> Floats:
    """How far values (n,) are from the linear map of ``terms`` (n, k) with the least absolute residuals.

    Residuals below ``limit`` count squared.
    """
    weights = off = np.ones_like(values)
    for _ in range(ROBUST_ROUNDS):
        off = np.abs(values - terms @ _weighted_map(terms, values, weights))
        weights = 1 / np.maximum(off, limit)
    return off


def _weighted_map(terms: Floats, values: Floats, weights: Floats) -> Floats:
    root = np.sqrt(weights)
    return np.asarray(np.linalg.lstsq(terms * root[:, None], values * root, rcond=None)[0])


def _surrounds(near: Floats) -> bool:
    """Whether points are on all sides of the origin, so that nothing is extrapolated."""
    return bool((near.min(0) < 0).all() and (near.max(0) > 0).all())


def explain(frames: PoseFrames, corners: Corners, projector_size_px: tuple[int, int]) -> str:
    """Why a code cannot be read: another order of the pictures that can, or else how they are lit."""
    bits = bit_counts(gray_code_of(frames, projector_size_px), projector_size_px)
    orders = _other_orders(list(frames.pairs), bits[0]) if frames.places_px is None else []
    for words, pairs in orders:
        code = code_places(replace(frames, pairs=pairs), projector_size_px)
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
