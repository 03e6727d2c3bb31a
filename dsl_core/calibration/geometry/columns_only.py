"""A projector of which only columns are seen, as under vertical stripes: what these tell, what is assumed.

A column is ``u = fx (r1 X + tx) / (r3 X + tz) + cx`` of a point X that the camera's boards give. So columns
tell the rows r1 and r3 of the rotation, from which r2 follows, and fx, cx, tx, tz. Nothing of fy and cy is in
them, and of ty only what the lens bends. Depth from columns does not need these three; rows of the projector
do, and with them light through a film. They are assumed: square pixels, an axis in the middle of the picture,
a projector as high as the camera, with deviations in which common devices are.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from dsl_core.calibration.geometry.bundle import (
    LENS,
    PROJECTOR,
    SHARED,
    STEREO,
    Adjustment,
    Prior,
    move,
    vector_of,
)
from dsl_core.calibration.geometry.plausible import OUTSIDE
from dsl_core.calibration.geometry.projector_corners import INLIER_PX, PoseObservation, off_most
from dsl_core.errors import CalibrationError
from dsl_core.model.calibration.geometry import GeometryCalibration
from dsl_core.model.figure import with_std
from dsl_core.optics.parallax import LEAST_PX
from dsl_core.solve.robust import robust_std

Floats = NDArray[np.float64]
Size = tuple[int, int]

#: Places of the projector's fy, cy and of ty among the parameters.
FX, FY, CX, CY = range(PROJECTOR.start, PROJECTOR.start + 4)
TY = STEREO.start + 4
#: Pixels of projectors are square but for pictures that these scale (deviation of fy / fx).
ASPECT_STD = 0.01
#: The axis is anywhere from half a picture above it to half a picture below, as far as lenses are shifted
#: (deviation of an even distribution, in heights of the picture).
CY_SHARE = (1 + 2 * OUTSIDE) / 12**0.5
#: How much higher or lower than the camera projectors stand, as a share of the distance of the boards.
HEIGHT_SHARE = 0.2
#: The first tangential term bends columns as a tilt of the projector does; it is small (deviation): lenses of
#: real rigs had 0.0006, 0.0029 and 0.0053.
TANGENTIAL, TANGENTIAL_STD = PROJECTOR.start + 6, 0.005
#: Rounds of the linear fit, and corners that are misread: so many deviations off a smooth map of their board.
ROUNDS, MISREAD_SIGMAS = 4, 5.0


def of_columns_only(poses: Sequence[PoseObservation]) -> bool:
    """Whether only columns were seen; raises `CalibrationError` when that differs from pose to pose."""
    without = [pose.name for pose in poses if pose.columns_only]
    if without and len(without) < len(poses):
        raise CalibrationError(
            f"{', '.join(without)} has only columns of the projector, the other poses also rows. Capture all"
            " poses under the same patterns."
        )
    return bool(without)


def start_from_columns(
    poses: Sequence[PoseObservation], boards: Floats, projector_size_px: Size
) -> tuple[Floats, Floats]:
    """Lens (9,) of the projector, and rotation vector and translation (6,), from boards (poses, 6) placed.

    The linear map of points to columns times distances by the smallest singular value (Hartley and Zisserman
    2004, 7.1, with one picture coordinate), of corners that are read well. Raises `CalibrationError` when no
    lens makes it.
    """
    points = np.concatenate(
        [move(*_spread(motion, pose))[0] for motion, pose in zip(boards, poses, strict=True)]
    )
    columns = np.concatenate([pose.projector_px[:, 0] for pose in poses])
    width, height = projector_size_px
    centre, size = points.mean(0), points.std()
    near = np.append((points - centre) / size, np.ones((len(points), 1)), 1)
    u = (columns - (width - 1) / 2) / width
    read = np.concatenate([_well_read(pose) for pose in poses])
    weights = read.astype(float)
    across = along = np.zeros(4)
    for _ in range(ROUNDS):
        rows = np.append(near, -u[:, None] * near, 1) * np.sqrt(weights)[:, None]
        across, along = np.linalg.svd(rows, full_matrices=False)[2][-1].reshape(2, 4)
        # Then the squares are those of columns, not of columns times distances.
        square = (near @ along) ** 2
        weights = read / np.maximum(square, 0.1 * np.median(square))
    back = np.eye(4)
    back[:3] /= size
    back[:3, 3] = -centre / size
    depth = along @ back
    column = width * (across @ back) + (width - 1) / 2 * depth
    length = float(np.linalg.norm(depth[:3])) * np.sign(np.median(near @ along))
    if length == 0 or not np.isfinite([*column, *depth]).all():
        raise CalibrationError(_NO_LENS)
    depth, column = depth / length, column / length
    cx = float(column[:3] @ depth[:3])
    turned = column[:3] - cx * depth[:3]
    fx = float(np.linalg.norm(turned))
    if fx <= 0:
        raise CalibrationError(_NO_LENS)
    r1, r3 = turned / fx, depth[:3]
    rotation = np.stack([r1, np.cross(r3, r1), r3])
    lens = np.zeros(LENS)
    lens[:4] = fx, fx, cx, (height - 1) / 2
    return lens, np.array([*vector_of(rotation), (column[3] - cx * depth[3]) / fx, 0.0, depth[3]])


def _well_read(pose: PoseObservation) -> NDArray[np.bool_]:
    """Corners (n,) whose columns are those of their neighbours on the board."""
    x, y = (pose.board_mm[:, :2] - pose.board_mm[:, :2].mean(0)).T / np.ptp(pose.board_mm)
    off = off_most(np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], 1), pose.projector_px[:, 0])
    return np.asarray(off <= INLIER_PX + MISREAD_SIGMAS * float(robust_std(off, 0)))


_NO_LENS = (
    "The projector cannot be calibrated from its columns: no lens makes them of the boards. Check that all"
    " pictures were taken with one set-up, and add poses with the board tilted about both axes and at other"
    " distances."
)


def _spread(motion: Floats, pose: PoseObservation) -> tuple[Floats, Floats]:
    return np.broadcast_to(motion, (len(pose.ids), 6)), pose.board_mm


def priors_of(parameters: Floats) -> list[Prior]:
    """What is known of ty and of a tangential term before any column is seen."""
    distance = float(np.median(parameters[SHARED:].reshape(-1, 6)[:, 5]))
    return [Prior(TY, 0.0, HEIGHT_SHARE * distance), Prior(TANGENTIAL, 0.0, TANGENTIAL_STD)]


def with_assumed_rows(fit: Adjustment, projector_size_px: Size) -> Adjustment:
    """The fit with fy and cy, of which no column says anything, as assumed and with what that leaves open."""
    height = projector_size_px[1]
    parameters, covariance = fit.parameters.copy(), fit.covariance.copy()
    parameters[FY], parameters[CY] = parameters[FX], (height - 1) / 2
    covariance[FY], covariance[:, FY] = covariance[FX], covariance[:, FX]
    covariance[FY, FY] = covariance[FX, FX] + (ASPECT_STD * parameters[FX]) ** 2
    covariance[CY, CY] = (CY_SHARE * height) ** 2
    return replace(fit, parameters=parameters, covariance=covariance)


def require_columns(poses: Sequence[PoseObservation]) -> None:
    """Raise `CalibrationError` for stripes that run along the camera's rows, or turned pictures."""
    slopes = np.array([_gradient(pose) for pose in poses])
    lying = np.abs(slopes[:, 1]) > np.abs(slopes[:, 0])
    if lying.any():
        names = ", ".join(pose.name for pose, odd in zip(poses, lying, strict=True) if odd)
        raise CalibrationError(
            f"In {names} the decoded columns run down the camera's picture, not across it: these are rows of"
            " the projector, or one of the devices is turned by 90 degrees. Give the pictures of vertical"
            " stripes, or project columns and rows, which tell the two apart."
        )
    reverse = slopes[:, 0] < 0
    few = reverse if 2 * reverse.sum() <= reverse.size else ~reverse
    if few.any():
        names = ", ".join(pose.name for pose, odd in zip(poses, few, strict=True) if odd)
        raise CalibrationError(
            f"In {names} the columns rise the other way across the camera's picture than in the other poses."
            " Turn or mirror back those pictures, or leave the pose out."
        )


def _gradient(pose: PoseObservation) -> Floats:
    """By how many columns the projector's place changes per camera pixel, across and down, (2,)."""
    from_middle = pose.camera_px - pose.camera_px.mean(0)
    columns = pose.projector_px[:, 0] - pose.projector_px[:, 0].mean()
    return np.asarray(np.linalg.lstsq(from_middle, columns, rcond=None)[0])


def columns_only_doubts(found: GeometryCalibration, poses: Sequence[PoseObservation]) -> list[str]:
    """What is assumed in place of rows, in a sentence, and what columns of such a rig do not tell."""
    lens, deviation = found.projector, found.projector_deviation
    ty, ty_std = found.pose.translation_mm[1], found.pose_deviation.translation_mm[1]
    sentences = [
        "Only columns of the projector were seen. Assumed of its rows: square pixels"
        f" (fy {with_std(lens.fy_px, deviation.fy_px, 0)} px), the axis in the middle"
        f" (cy {with_std(lens.cy_px, deviation.cy_px, 0)} px), and, as far as the lens does not tell, a"
        f" projector as high as the camera (ty {with_std(ty, ty_std, 0)} mm). Depth from columns does not"
        " need them, but spectra through a film do: their error may be ten times as large. Project rows too"
        " before you measure spectra."
    ]
    if all(_gradient(each)[0] < 0 for each in poses):
        sentences.append(
            "Columns of the projector rise from right to left in the camera's picture. It is taken to be"
            " upside down; if its picture is mirrored (rear mode), depth is the same, but its rows run the"
            " other way."
        )
    parallax = _parallax_px(found, poses)
    if parallax < LEAST_PX:
        sentences.append(
            f"A point 1 % farther away is seen only {parallax:.2f} columns elsewhere: camera and projector"
            " stand one above the other, along the stripes. Move one of them to the side, or project rows."
        )
    return sentences


def _parallax_px(found: GeometryCalibration, poses: Sequence[PoseObservation]) -> float:
    """By how many columns a point moves that is farther from the camera by a hundredth, median."""
    distances = {pose.name: pose.distance_mm for pose in found.poses}
    tx, _, tz = found.pose.translation_mm
    lens = found.projector
    each = [
        0.01 * np.abs(lens.fx_px * tx - (pose.projector_px[:, 0] - lens.cx_px) * tz) / distances[pose.name]
        for pose in poses
    ]
    return float(np.median(np.concatenate(each)))
