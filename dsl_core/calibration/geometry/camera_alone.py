"""The lens of a camera by itself, from pictures of a printed board without any code (Zhang, PAMI 2000)."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsl_core.calibration.geometry.boards import Corners, find_corners
from dsl_core.calibration.geometry.bundle import MARGIN
from dsl_core.calibration.geometry.pose_series import (
    GOOD_TILT_DEG,
    MIN_COVERAGE,
    MIN_POSES,
    MIN_TILT_DEG,
    board_normal,
    coverage,
    largest_angle_deg,
)
from dsl_core.calibration.geometry.solve import lens_of, opencv_flags
from dsl_core.errors import CalibrationError
from dsl_core.model.board import Board, corner_positions_mm
from dsl_core.model.calibration.geometry import LeftOut, LensDeviation
from dsl_core.model.geometry import Lens


@dataclass(frozen=True)
class CameraAlone:
    """A lens (px) with its deviations, the errors of its corners (rms, px), and what is doubtful about it.

    ``pictures`` has the name, the number of corners and their error (rms, px) of each picture that was used.
    """

    lens: Lens
    deviation: LensDeviation
    rms_px: float
    coverage: float
    pictures: tuple[tuple[str, int, float], ...]
    left_out: tuple[LeftOut, ...]
    warnings: tuple[str, ...]


def calibrate_camera(
    pictures: Iterable[tuple[str, NDArray[np.float32]]], board: Board, hold: Collection[str] = ()
) -> CameraAlone:
    """The lens of the camera that took named grey pictures (rows, columns) of one board, linear in light.

    Leaves out pictures without the board. Terms of distortion in ``hold`` are zero. Raises `CalibrationError`
    for too few pictures, pictures of several sizes, and boards that are all parallel.
    """
    seen: list[tuple[str, Corners]] = []
    left_out: list[LeftOut] = []
    size_px: tuple[int, int] | None = None
    for name, grey in pictures:
        here = (grey.shape[1], grey.shape[0])
        size_px = size_px or here
        if here != size_px:
            raise CalibrationError(
                f"{name} is {here[0]} x {here[1]} px, the first picture {size_px[0]} x {size_px[1]} px. Give"
                " pictures of one camera at one setting."
            )
        try:
            seen.append((name, find_corners(grey, board, name)))
        except CalibrationError as error:
            left_out.append(LeftOut(name=name, reason=str(error)))
    if len(seen) < MIN_POSES or size_px is None:
        reasons = " ".join(each.reason for each in left_out)
        raise CalibrationError(
            f"The board was found in {len(seen)} of {len(seen) + len(left_out)} pictures; {MIN_POSES} are"
            f" needed, 10 are good. {reasons}".strip()
        )
    return _solved(seen, board, size_px, hold, tuple(left_out))


def _solved(
    seen: list[tuple[str, Corners]],
    board: Board,
    size_px: tuple[int, int],
    hold: Collection[str],
    left_out: tuple[LeftOut, ...],
) -> CameraAlone:
    import cv2

    places = corner_positions_mm(board)
    boards = [places[corners.ids].astype(np.float32) for _, corners in seen]
    points = [corners.points_px.astype(np.float32) for _, corners in seen]
    flags = opencv_flags(hold) | (cv2.CALIB_FIX_K3 if "k3" in hold else 0)
    try:
        rms, matrix, distortion, _, _, deviations, _, errors = cv2.calibrateCameraExtended(
            boards, points, size_px, np.eye(3), np.zeros(5), flags=flags
        )
    except cv2.error as error:
        raise CalibrationError(
            f"The camera cannot be calibrated from these pictures ({error.err}). Add some with more tilt."
        ) from error
    values = np.array([matrix[0, 0], matrix[1, 1], matrix[0, 2], matrix[1, 2], *np.ravel(distortion)[:5]])
    if not np.isfinite(values).all():
        raise CalibrationError("No lens fits these pictures. Check the number of corners of the board.")
    normals = [
        board_normal(places[corners.ids], corners.points_px, np.asarray(matrix), name)
        for name, corners in seen
    ]
    tilt_deg = largest_angle_deg(np.array(normals))
    if tilt_deg < MIN_TILT_DEG:
        raise CalibrationError(
            f"All boards are nearly parallel (at most {tilt_deg:.1f} degrees apart), so that focal length and"
            f" distance cannot be told apart. Tilt the board by {GOOD_TILT_DEG:.0f} to 45 degrees."
        )
    share = coverage(np.concatenate([corners.points_px for _, corners in seen]), size_px)
    warnings = [f"{each.name} is left out: {each.reason}" for each in left_out]
    if share < MIN_COVERAGE:
        warnings.append(
            f"Corners cover {share:.0%} of the picture; distortion outside is a guess. Add pictures with the"
            " board near the edges."
        )
    if tilt_deg < GOOD_TILT_DEG:
        warnings.append(
            f"The board was tilted by {tilt_deg:.0f} degrees at most. Tilt it by {GOOD_TILT_DEG:.0f} to 45."
        )
    fx, fy, cx, cy, k1, k2, p1, p2, k3 = (float(v) for v in MARGIN * np.ravel(deviations)[:9])
    return CameraAlone(
        lens_of(values, size_px),
        LensDeviation(fx_px=fx, fy_px=fy, cx_px=cx, cy_px=cy, distortion=(k1, k2, p1, p2, k3)),
        float(rms),
        share,
        tuple(
            (name, len(corners.ids), float(error))
            for (name, corners), error in zip(seen, np.ravel(errors), strict=True)
        ),
        left_out,
        tuple(warnings),
    )
