"""Lenses and pose of camera and projector from poses of a printed board, film off."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np
from numpy.typing import NDArray

from dsl_core.calibration.geometry.bundle import (
    CAMERA,
    PROJECTOR,
    SHARED,
    STEREO,
    TERMS,
    Adjustment,
    Prior,
    adjust,
    flatness,
    move,
    refit,
    rotation_of,
    triangulate,
    vector_of,
)
from dsl_core.calibration.geometry.columns_only import (
    columns_only_doubts,
    of_columns_only,
    priors_of,
    start_from_columns,
    with_assumed_rows,
)
from dsl_core.calibration.geometry.knocked import knocked
from dsl_core.calibration.geometry.pose_series import (
    GOOD_RMS_PX,
    check_poses,
    columns_per_pixel,
    coverage,
    doubts,
    largest_angle_deg,
)
from dsl_core.calibration.geometry.projector_corners import PoseObservation
from dsl_core.calibration.geometry.stretched import looks_turned, sentence_on, stretched
from dsl_core.errors import CalibrationError
from dsl_core.model.board import Board
from dsl_core.model.calibration.geometry import (
    Flatness,
    GeometryCalibration,
    LeftOut,
    LensDeviation,
    PoseDeviation,
    PoseQuality,
)
from dsl_core.model.geometry import Lens, Pose

Floats = NDArray[np.float64]
Size = tuple[int, int]

#: A pose does not fit when its error is this many times that of the typical pose, or so many corners are off.
OUTLIER_POSE, OUTLIER_SHARE = 3.0, 0.4
#: And only where that matters: above this share of the error that a whole calibration may have (px). Where
#: the projector's pixels are finer, in those of the camera: no corner is known better than it sees them.
HARMFUL_PX = GOOD_RMS_PX / 4
MIN_POSES_TO_LEAVE_OUT = 4


def calibrate_geometry(
    poses: Sequence[PoseObservation],
    board: Board,
    camera_size_px: Size,
    projector_size_px: Size,
    *,
    camera_binning: float = 1.0,
    baseline_mm: float | None = None,
    left_out: Sequence[LeftOut] = (),
    warnings: Sequence[str] = (),
    hold: Collection[str] = (),
) -> GeometryCalibration:
    """Calibrate both lenses and their pose; sizes are (width, height).

    Starts from OpenCV's calibration of each device, refines everything jointly, leaves out poses that do not
    fit, and then checks itself with each pose left out in turn. ``baseline_mm``, the distance of the devices
    measured by hand, lets a wrong printed size be noticed. ``left_out`` and ``warnings`` are passed on.
    Terms of distortion in ``hold`` (see `TERMS`) are zero in both lenses: few poses do not determine all.
    Raises `CalibrationError` for poses no calibration can come from, and terms that there are not.
    """
    held = _places_of(hold)
    check_poses(poses, camera_size_px)
    columns_only = of_columns_only(poses)
    start = initial(poses, camera_size_px, projector_size_px, hold)
    priors = [each for each in priors_of(start) if each.number not in held] if columns_only else []
    fit = adjust(poses, start, held, priors)
    kept = _fitting(poses, fit)
    stretch = None if looks_turned(board) else stretched(poses, fit, held, priors)
    if stretch is not None:
        fits = _fitting(stretch.poses, stretch.fit)
        if (fits | ~kept).all():
            poses, fit, kept = stretch.poses, stretch.fit, fits
        else:
            stretch = None
    final = fit
    if not kept.all():
        rest = [pose for pose, keep in zip(poses, kept, strict=True) if keep]
        misfits = [pose.name for pose, keep in zip(poses, kept, strict=True) if not keep]
        check_poses(rest, camera_size_px, misfits)
        final = adjust(rest, without(fit.parameters, np.flatnonzero(~kept)), held, priors)
    if columns_only:
        final = with_assumed_rows(final, projector_size_px)
    qualities = _qualities(poses, kept, fit, final, board, held, priors)
    found = _record(poses, kept, final, qualities, board, camera_size_px, projector_size_px)
    found = found.model_copy(
        update={
            "camera_binning": camera_binning,
            "left_out": tuple(left_out),
            "columns_only": columns_only,
        }
    )
    normals = [rotation_of(motion[:3])[:, 2] for motion in final.parameters[SHARED:].reshape(-1, 6)]
    tilt = largest_angle_deg(np.array(normals))
    unseen = columns_only_doubts(found, poses) if columns_only else []
    fitting = [pose for pose, keep in zip(poses, kept, strict=True) if keep]
    knock = knocked(fitting, final.parameters)
    unseen += [] if knock is None else [knock.sentence]
    unseen += [] if stretch is None else [sentence_on(stretch.share, board)]
    return found.model_copy(update={"warnings": (*unseen, *warnings, *doubts(found, tilt, baseline_mm))})


def opencv_flags(hold: Collection[str]) -> int:
    """Flags of OpenCV's calibration that hold terms at zero, but for k3; raises `CalibrationError`."""
    import cv2

    _places_of(hold)
    fixed = {"k1": cv2.CALIB_FIX_K1, "k2": cv2.CALIB_FIX_K2, "tangential": cv2.CALIB_ZERO_TANGENT_DIST}
    return sum(flag for term, flag in fixed.items() if term in hold)


def _places_of(hold: Collection[str]) -> list[int]:
    """Numbers of the parameters of both lenses that are held at zero; raises `CalibrationError`."""
    unknown = [term for term in hold if term not in TERMS]
    if unknown:
        raise CalibrationError(
            f"{', '.join(unknown)} cannot be held at zero; terms of the distortion are {', '.join(TERMS)}."
        )
    return [lens.start + place for lens in (CAMERA, PROJECTOR) for term in hold for place in TERMS[term]]


def initial(
    poses: Sequence[PoseObservation],
    camera_size_px: Size,
    projector_size_px: Size,
    hold: Collection[str] = (),
) -> Floats:
    """Start of the joint fit: each device for itself, then the median of the poses between them.

    Where only columns are seen, the projector follows from the boards that the camera's fit has placed.
    """
    camera, camera_boards = _alone(poses, "camera", camera_size_px, hold)
    if of_columns_only(poses):
        projector, stereo = start_from_columns(poses, camera_boards, projector_size_px)
        return np.concatenate([camera, projector, stereo, camera_boards.ravel()])
    projector, projector_boards = _alone(poses, "projector", projector_size_px, hold)
    between = []
    for ours, theirs in zip(camera_boards, projector_boards, strict=True):
        turn = rotation_of(theirs[:3]) @ rotation_of(ours[:3]).T
        between.append([*vector_of(turn), *(theirs[3:] - turn @ ours[3:])])
    return np.concatenate([camera, projector, np.median(between, 0), camera_boards.ravel()])


def _alone(
    poses: Sequence[PoseObservation], device: str, size_px: Size, hold: Collection[str]
) -> tuple[Floats, Floats]:
    """Lens (9,) and board poses (poses, 6) of one device by OpenCV; k3 is left to the joint fit."""
    import cv2

    flags = cv2.CALIB_FIX_K3 | opencv_flags(hold)
    seen = [pose.camera_px if device == "camera" else pose.projector_px for pose in poses]
    try:
        _, matrix, distortion, turns, shifts = cv2.calibrateCamera(
            [pose.board_mm.astype(np.float32) for pose in poses],
            [points.astype(np.float32) for points in seen],
            size_px,
            np.eye(3),
            np.zeros(5),
            flags=flags,
        )
    except cv2.error as error:
        raise CalibrationError(
            f"The {device} cannot be calibrated from these poses ({error.err}). Add poses with more tilt."
        ) from error
    lens = [matrix[0, 0], matrix[1, 1], matrix[0, 2], matrix[1, 2], *np.ravel(distortion)[:5]]
    boards = np.concatenate([np.reshape(turns, (-1, 3)), np.reshape(shifts, (-1, 3))], 1)
    if not (np.isfinite(lens).all() and np.isfinite(boards).all()) or matrix[0, 0] <= 0:
        raise CalibrationError(
            f"The {device} cannot be calibrated from these poses: no focal length fits. Check the number of"
            " corners of the board and the projector's size, and add poses with more tilt."
        )
    return np.array(lens, float), np.asarray(boards, np.float64)


def without(parameters: Floats, poses: Sequence[int] | NDArray[np.integer]) -> Floats:
    """Parameters without some board poses."""
    boards = np.delete(parameters[SHARED:].reshape(-1, 6), poses, 0)
    return np.concatenate([parameters[:SHARED], boards.ravel()])


def _fitting(poses: Sequence[PoseObservation], fit: Adjustment) -> NDArray[np.bool_]:
    """Which poses agree with the others, or differ from them by too little to do harm."""
    errors = np.array([_rms_px(fit, part, only_used=False) for part in _parts(poses)])
    finer = np.array([max(1.0, columns_per_pixel(pose)) for pose in poses])
    lost = np.array([1 - fit.used[part].mean() for part in _parts(poses)])
    far = (np.median(np.abs(errors), 0) * OUTLIER_POSE < errors).any(1) & (lost > OUTLIER_SHARE / 2)
    harmful = (errors / np.stack([np.ones_like(finer), finer], 1) > HARMFUL_PX).any(1)
    return np.asarray(~(harmful & (far | (lost > OUTLIER_SHARE))))


def _parts(poses: Sequence[PoseObservation]) -> list[slice]:
    ends = np.cumsum([len(pose.ids) for pose in poses])
    return [slice(end - len(pose.ids), end) for pose, end in zip(poses, ends, strict=True)]


def _rms_px(fit: Adjustment, part: slice, only_used: bool = True) -> tuple[float, float]:
    """Camera and projector error of some corners, rms length, px."""
    chosen = fit.used[part] if only_used and fit.used[part].any() else np.ones_like(fit.used[part])
    camera, projector = fit.camera_residual_px[part][chosen], fit.projector_residual_px[part][chosen]
    return float(np.sqrt((camera**2).sum(1).mean())), float(np.sqrt((projector**2).sum(1).mean()))


def _qualities(
    poses: Sequence[PoseObservation],
    kept: NDArray[np.bool_],
    first: Adjustment,
    final: Adjustment,
    board: Board,
    held: Collection[int],
    priors: Sequence[Prior],
) -> list[PoseQuality]:
    """Figures of each pose: of one that was left out, those of the fit that it did not fit."""
    positions = np.cumsum(kept) - 1
    kept_poses = [pose for pose, keep in zip(poses, kept, strict=True) if keep]
    final_parts, first_parts = _parts(kept_poses), _parts(poses)
    found = []
    for index, pose in enumerate(poses):
        fit, part = (final, final_parts[positions[index]]) if kept[index] else (first, first_parts[index])
        at = int(positions[index]) if kept[index] else index
        motion = fit.parameters[SHARED:].reshape(-1, 6)[at]
        used = fit.used[part] if fit.used[part].sum() >= 4 else np.ones(len(pose.ids), bool)
        camera, projector = _rms_px(fit, part)
        left_out = None
        if kept[index] and len(kept_poses) >= MIN_POSES_TO_LEAVE_OUT:
            rest = [other for i, other in enumerate(kept_poses) if i != at]
            unseen = refit(rest, without(final.parameters, [at]), held, priors)
            left_out = _measured(unseen, pose.only(used), motion, board)
        found.append(
            PoseQuality(
                name=pose.name,
                corners=len(pose.ids),
                outliers=int((~fit.used[part]).sum()),
                used=bool(kept[index]),
                camera_rms_px=camera,
                projector_rms_px=projector,
                distance_mm=float(_placed(motion, pose)[:, 2].mean()),
                tilt_deg=float(np.degrees(np.arccos(min(abs(rotation_of(motion[:3])[2, 2]), 1.0)))),
                measured=_measured(final.parameters, pose.only(used), motion, board),
                left_out=left_out,
                corners_px=tuple((float(x), float(y)) for x, y in np.round(pose.camera_px, 2)),
            )
        )
    return found


def _placed(motion: Floats, pose: PoseObservation) -> Floats:
    return move(np.broadcast_to(motion, (len(pose.ids), 6)), pose.board_mm)[0]


def _measured(parameters: Floats, pose: PoseObservation, motion: Floats, board: Board) -> Flatness:
    points = triangulate(parameters[:SHARED], pose, _placed(motion, pose))
    return flatness(points, pose.ids, board)


def _record(
    poses: Sequence[PoseObservation],
    kept: NDArray[np.bool_],
    fit: Adjustment,
    qualities: Sequence[PoseQuality],
    board: Board,
    camera_size_px: Size,
    projector_size_px: Size,
) -> GeometryCalibration:
    axes = 1 if of_columns_only(poses) else 2
    values, deviations = fit.parameters, np.sqrt(np.diag(fit.covariance).clip(0))
    camera, projector = _rms_px(fit, slice(None))
    chosen = [pose for pose, keep in zip(poses, kept, strict=True) if keep]
    sides = [quality.measured for quality in qualities if quality.used]
    mean = float(np.mean([side.square_mm for side in sides]))
    spread = [side.square_std_mm**2 + (side.square_mm - mean) ** 2 for side in sides]
    return GeometryCalibration(
        board=board,
        camera=lens_of(values[CAMERA], camera_size_px),
        projector=lens_of(values[PROJECTOR], projector_size_px),
        pose=pose_of(values[STEREO]),
        camera_deviation=_lens_deviation(deviations[CAMERA]),
        projector_deviation=_lens_deviation(deviations[PROJECTOR]),
        pose_deviation=_pose_deviation(deviations[STEREO]),
        covariance=tuple(fit.covariance[:SHARED, :SHARED].ravel().tolist()),
        camera_rms_px=camera,
        projector_rms_px=projector,
        rms_px=float(np.hypot(camera, projector) / np.sqrt(2)),
        rms_with_outliers_px=float(np.sqrt(np.square(_rms_px(fit, slice(None), only_used=False)).mean())),
        camera_coverage=coverage(np.concatenate([pose.camera_px for pose in chosen]), camera_size_px),
        projector_coverage=coverage(
            np.concatenate([pose.projector_px[:, :axes] for pose in chosen]), projector_size_px[:axes]
        ),
        squares=Flatness(
            square_mm=mean,
            square_std_mm=float(np.sqrt(np.mean(spread))),
            plane_rms_mm=float(np.sqrt(np.mean([side.plane_rms_mm**2 for side in sides]))),
        ),
        poses=tuple(qualities),
    )


def lens_of(values: Floats, size_px: Size) -> Lens:
    """The lens of nine fitted numbers; raises `CalibrationError` when they are none of a lens."""
    fx, fy, cx, cy, k1, k2, p1, p2, k3 = (float(value) for value in values)
    if min(fx, fy) <= 0:
        raise CalibrationError("The joint fit ended with a negative focal length. Add poses with more tilt.")
    return Lens(
        width_px=size_px[0], height_px=size_px[1], fx_px=fx, fy_px=fy, cx_px=cx, cy_px=cy,
        distortion=(k1, k2, p1, p2, k3),
    )  # fmt: skip


def _lens_deviation(values: Floats) -> LensDeviation:
    fx, fy, cx, cy, k1, k2, p1, p2, k3 = (float(value) for value in values)
    return LensDeviation(fx_px=fx, fy_px=fy, cx_px=cx, cy_px=cy, distortion=(k1, k2, p1, p2, k3))


def pose_of(motion: Floats) -> Pose:
    """The pose of a rotation vector and a translation (mm)."""
    rotation = tuple(map(tuple, rotation_of(motion[:3]).tolist()))
    return Pose(rotation=rotation, translation_mm=tuple(motion[3:].tolist()))  # type: ignore[arg-type]


def _pose_deviation(values: Floats) -> PoseDeviation:
    rx, ry, rz, x, y, z = (float(value) for value in values)
    turns = (float(np.degrees(rx)), float(np.degrees(ry)), float(np.degrees(rz)))
    return PoseDeviation(rotation_deg=turns, translation_mm=(x, y, z))
