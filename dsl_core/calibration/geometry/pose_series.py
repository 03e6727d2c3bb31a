"""Many poses of a board: what each shows, which cannot be used and why, and what is doubtful about them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from dsl_core.calibration.geometry.boards import grey_of, other_board, saturated
from dsl_core.calibration.geometry.bundle import LENS
from dsl_core.calibration.geometry.code_model import code_light
from dsl_core.calibration.geometry.columns_only import of_columns_only, require_columns
from dsl_core.calibration.geometry.common_view import wanted_coverage
from dsl_core.calibration.geometry.plausible import implausible
from dsl_core.calibration.geometry.projector_corners import PoseObservation, observe_pose
from dsl_core.errors import CalibrationError
from dsl_core.model.board import Board
from dsl_core.model.calibration.geometry import GeometryCalibration, LeftOut, LensDeviation
from dsl_core.model.calibration.pose_frames import PoseFrames
from dsl_core.model.figure import with_std
from dsl_core.model.geometry import Lens

#: A pose is blurred when its edges are this many times as wide as those of the others, and so wide (px).
BLURRED, LEAST_BLUR_PX = 2.0, 0.8
#: Pictures are linear when half the light reads as half the value; gammas farther from 1 are reported.
GAMMA_TOLERANCE = 0.15
#: Pixels whose pattern and inverse differ by less than this share see half the light in each.
HALF_LIT, LEAST_PIXELS = 0.15, 200
Size = tuple[int, int]

MIN_POSES = 3
#: Poses tilted less than this against each other do not determine the focal lengths; more is advised.
MIN_TILT_DEG, GOOD_TILT_DEG = 5.0, 20.0
#: Share of the pixels on the board that may be saturated.
MAX_SATURATED = 0.01
MIN_COVERAGE, CELLS = 0.3, 8
GOOD_RMS_PX, GOOD_FOCAL_SHARE = 0.5, 0.01
#: What the distortion may leave open in the corners of a picture, px; of the projector's, at least this share
#: of what a pixel of the camera sees of it, as coarse pictures tell its columns as much less well.
MAX_CORNER_PX, CORNER_SHARE = 1.0, 0.5


@dataclass
class PoseSeries:
    """The poses that can be used, those that cannot, and warnings that name a pose."""

    seen: list[PoseObservation] = field(default_factory=list)
    left_out: list[LeftOut] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)


def observe_series(
    poses: Iterable[PoseFrames], board: Board, projector_size_px: tuple[int, int]
) -> PoseSeries:
    """Look at one pose after the other, and leave out those whose board or code cannot be read.

    Raises `CalibrationError` with the reasons when fewer than three are left. What the iterable raises (such
    as pictures that are missing) ends the series.
    """
    found = PoseSeries()
    gammas = []
    first_out: PoseFrames | None = None
    for frames in poses:
        try:
            pose = observe_pose(frames, board, projector_size_px)
        except CalibrationError as error:
            found.left_out.append(LeftOut(name=frames.name, reason=str(error)))
            first_out = first_out or frames
            continue
        found.seen.append(pose)
        gammas.append(picture_gamma(frames, projector_size_px))
        found.warnings += [doubt for doubt in [exposure_warning(frames, pose)] if doubt]
    if found.left_out and len(found.seen) < MIN_POSES:
        reasons = " ".join(each.reason for each in found.left_out)
        instead = ""
        if first_out is not None and not found.seen:
            instead = other_board(grey_of(first_out.white, first_out.bayer), board)
        raise CalibrationError(
            f"Only {len(found.seen)} of {len(found.seen) + len(found.left_out)} poses can be used,"
            f" {MIN_POSES} are needed.{instead} {reasons}"
        )
    found.warnings += [f"{each.name} is left out: {each.reason}" for each in found.left_out]
    found.warnings += _blurred(found.seen) + _bent(np.array(gammas))
    return found


def _blurred(seen: list[PoseObservation]) -> list[str]:
    typical = float(np.median([pose.blur_px for pose in seen])) if seen else 0.0
    return [
        f"{pose.name} is blurred: its edges are {pose.blur_px:.1f} px wide, those of the other poses"
        f" {typical:.1f} px. Focus, hold the board still, and capture the pose again."
        for pose in seen
        if pose.blur_px > max(BLURRED * typical, LEAST_BLUR_PX)
    ]


def picture_gamma(frames: PoseFrames, projector_size_px: tuple[int, int]) -> float:
    """From light to the value of a pixel: the exponent, 1 for a linear camera; NaN where unknown.

    Where the edges of the finest stripes cross a pixel, it gets half of white's light from the pattern and
    from its inverse, so that their sum over white is ``2 * 0.5**gamma``. Codes that came decoded do not tell.
    """
    if not frames.pairs:
        return float("nan")
    columns = code_light(frames, projector_size_px)[0]
    pair = (projector_size_px[0] - 1).bit_length() - 1
    one, other, white, black = (
        grey_of(p) for p in (frames.pairs[2 * pair], frames.pairs[2 * pair + 1], frames.white, frames.black)
    )
    half = (columns.weight > 0) & (np.abs(columns.contrast[-1]) < HALF_LIT)
    half &= white - black > 0.3 * np.quantile(white - black, 0.99)
    if half.sum() < LEAST_PIXELS:
        return float("nan")
    ratio = float(np.median((one + other - 2 * black)[half] / (white - black)[half]))
    return 1 - float(np.log2(max(ratio, 1e-3)))


def _bent(gammas: NDArray[np.float64]) -> list[str]:
    known = gammas[np.isfinite(gammas)]
    if not len(known) or abs(np.median(known) - 1) <= GAMMA_TOLERANCE:
        return []
    gamma = float(np.median(known))
    if gamma > 1:
        # Levels between black and white, that only a scaled picture has, give less than their share of light.
        return [
            f"Fine stripes give too little light, as if half of it had a gamma of {gamma:.2f}: the projector"
            " scales or smooths its picture. Send its own resolution, and switch off keystone correction,"
            " zoom, overscan and dynamic contrast; or the camera is not linear."
        ]
    return [
        f"The pictures are not linear: half the light corresponds to a gamma of {gamma:.2f}."
        " Switch off the camera's gamma and the projector's dynamic contrast, which shift corners and bits."
    ]


def exposure_warning(frames: PoseFrames, seen: PoseObservation) -> str | None:
    """A sentence when the board is over-exposed on the white picture of a pose."""
    (left, top), (right, bottom) = seen.camera_px.min(0).astype(int), seen.camera_px.max(0).astype(int)
    share = float(saturated(frames)[max(top, 0) : bottom + 1, max(left, 0) : right + 1].mean())
    if share <= MAX_SATURATED:
        return None
    return (
        f"{frames.name} is over-exposed: {share:.0%} of the white picture's pixels on the board are saturated"
        ", which shifts its corners. Expose less and capture the pose again."
    )


def check_poses(poses: Sequence[PoseObservation], camera_size_px: Size, misfits: Sequence[str] = ()) -> None:
    """Raise `CalibrationError` for poses that cannot be calibrated from, saying what to do.

    ``misfits`` name those that are not among them because they do not fit the others.
    """
    if len(poses) < MIN_POSES:
        apart = ""
        if misfits:
            apart = (
                f" {', '.join(misfits)} could be read, but not by the same lenses and pose of the devices as"
                " the others: something was moved, zoomed or focused, or the pictures were cropped or turned."
            )
        raise CalibrationError(
            f"{len(poses)} usable poses of the board are too few: {MIN_POSES} are needed, 10 are good.{apart}"
            " Add poses with the board tilted in different directions."
        )
    for pose in poses:
        seen = pose.projector_px[:, 0] if pose.columns_only else pose.projector_px
        if not all(np.isfinite(v).all() for v in (pose.board_mm, pose.camera_px, seen)):
            raise CalibrationError(f"{pose.name} has corners that are not finite. Capture the pose again.")
    if of_columns_only(poses):
        require_columns(poses)
    else:
        _check_axes(poses)
        _require_one_way_up(poses)
    tilt = largest_tilt_deg(poses, camera_size_px)
    if tilt < MIN_TILT_DEG:
        raise CalibrationError(
            f"All poses of the board are nearly parallel (at most {tilt:.1f} degrees apart), so focal"
            f" lengths and distances cannot be told apart. Tilt the board by {GOOD_TILT_DEG:.0f} to 45"
            " degrees in different directions."
        )


def _check_axes(poses: Sequence[PoseObservation]) -> None:
    """A camera and a projector in front of a board see it with one handedness; mirror images are mistakes."""
    slopes = np.array([_affine(pose.camera_px, pose.projector_px) for pose in poses])
    mirrored = np.linalg.det(slopes) < 0
    if not mirrored.any():
        return
    names = ", ".join(pose.name for pose, odd in zip(poses, mirrored, strict=True) if odd)
    typical = np.abs(slopes[mirrored]).mean(0)
    if typical[0, 1] + typical[1, 0] > typical[0, 0] + typical[1, 1]:
        cause = (
            "either the axes are swapped, and rows of the projector are decoded as columns: show the columns'"
            " bits first. Or the camera is turned by a right angle, and one of both pictures is mirrored:"
            " switch off the mirroring of both (rear or ceiling mode of the projector)"
        )
    else:
        axis = "left to right" if slopes[mirrored][:, 0, 0].mean() < 0 else "top to bottom"
        cause = (
            f"that of the projector, or else of the camera, is mirrored {axis}. Switch off the mirroring"
            " of both (rear or ceiling mode of the projector)"
        )
    raise CalibrationError(f"In {names} the images of camera and projector mirror each other: {cause}.")


def _require_one_way_up(poses: Sequence[PoseObservation]) -> None:
    """Devices that do not move keep the same way up; pictures that were turned later do not."""
    slopes = np.array([_affine(pose.camera_px, pose.projector_px) for pose in poses])
    # Cosine and sine of the turn between both pictures, which is any, but alike in all poses.
    turns = np.stack([slopes[:, 0, 0] + slopes[:, 1, 1], slopes[:, 1, 0] - slopes[:, 0, 1]], 1)
    turned = turns @ np.linalg.svd(turns, full_matrices=False)[2][0] < 0
    few = turned if 2 * turned.sum() <= turned.size else ~turned
    if few.any():
        names = ", ".join(pose.name for pose, odd in zip(poses, few, strict=True) if odd)
        raise CalibrationError(
            f"In {names} the camera's picture is upside down, unlike in the other poses. Turn back those"
            " pictures, or leave the pose out; the camera must not be turned between poses."
        )


def largest_tilt_deg(poses: Sequence[PoseObservation], camera_size_px: Size) -> float:
    """Largest angle between two poses of the board, degrees, judged before any lens is known.

    The normal of a plane is ``K^T l`` with its vanishing line l (Hartley and Zisserman 2004, 8.6.3); the
    focal length is taken as a typical one, which serves to tell parallel poses from tilted ones.
    """
    width, height = camera_size_px
    focal = 1.5 * max(width, height)
    matrix = np.array([[focal, 0, (width - 1) / 2], [0, focal, (height - 1) / 2], [0, 0, 1]])
    return largest_angle_deg(
        np.array([board_normal(pose.board_mm, pose.camera_px, matrix, pose.name) for pose in poses])
    )


def largest_angle_deg(normals: NDArray[np.float64]) -> float:
    """Largest angle between unit normals (n, 3) of either sign, degrees."""
    return float(np.degrees(np.arccos(np.clip(np.abs(normals @ normals.T), 0, 1))).max())


def board_normal(
    board_mm: NDArray[np.float64], camera_px: NDArray[np.float64], matrix: NDArray[np.float64], name: str
) -> NDArray[np.float64]:
    """Unit normal of a board in camera coordinates, (3,), either sign, from corners and camera matrix."""
    import cv2

    homography, _ = cv2.findHomography(board_mm[:, :2], camera_px, 0)
    if homography is None:
        raise CalibrationError(f"The corners of {name} are on one line. Leave this pose out.")
    normal = matrix.T @ np.linalg.inv(np.asarray(homography, np.float64)).T @ np.array([0.0, 0.0, 1.0])
    return np.asarray(normal / np.linalg.norm(normal))


def _affine(source: NDArray[np.float64], target: NDArray[np.float64]) -> NDArray[np.float64]:
    """The 2 x 2 part of the affine map that fits best."""
    fit = np.linalg.lstsq(source - source.mean(0), target - target.mean(0), rcond=None)[0]
    return np.asarray(fit.T)


def columns_per_pixel(pose: PoseObservation) -> float:
    """How many columns of the projector a pixel of the camera sees on the board."""
    return float(np.hypot(*_affine(pose.camera_px, pose.projector_px[:, :1])[0]))


def coverage(points_px: NDArray[np.float64], size_px: Sequence[int]) -> float:
    """Share of the cells of a grid over the picture that hold a corner; points (n, axes), as many sizes."""
    cells = np.floor((points_px + 0.5) / np.array(size_px) * CELLS).astype(int)
    inside = ((cells >= 0) & (cells < CELLS)).all(1)
    return float(len(np.unique(cells[inside], axis=0)) / CELLS ** len(size_px))


def doubts(found: GeometryCalibration, tilt_deg: float, baseline_mm: float | None) -> list[str]:
    """What a calibration that succeeded may still suffer from; ``baseline_mm`` is measured by hand."""
    sentences = [
        f"{pose.name} does not fit the other poses (camera {pose.camera_rms_px:.2f}, projector"
        f" {pose.projector_rms_px:.2f} px) and was left out: the board or rig moved during the capture, or"
        " its pictures are blurred or over-exposed. Capture it again."
        for pose in found.poses
        if not pose.used
    ]
    covered = (found.camera_coverage, found.projector_coverage)
    least = wanted_coverage(found, MIN_COVERAGE)
    for what, share, wanted in zip(("camera", "projector"), covered, least, strict=True):
        if share < wanted:
            sentences.append(
                f"Corners cover {share:.0%} of the {what}'s picture; distortion outside is a guess."
                " Add poses with the board near the edges."
            )
    lenses = (
        ("camera", found.camera, found.camera_deviation),
        ("projector", found.projector, found.projector_deviation),
    )
    for what, lens, deviation in lenses:
        if deviation.fx_px > GOOD_FOCAL_SHARE * lens.fx_px:
            sentences.append(
                f"The focal length of the {what} is known only to {deviation.fx_px / lens.fx_px:.1%}."
                " Add poses with more tilt."
            )
        corner_px = _corner_px(found, lens, 0 if what == "camera" else LENS)
        if corner_px > _most_corner_px(found, lens):
            sentences.append(
                f"The distortion of the {what} is poorly known beyond the board{_k3(lens, deviation)}:"
                f" {corner_px:.1f} px in a corner of its picture."
                " Add poses near the edges."
            )
        if abs(lens.fx_px / lens.fy_px - 1) > 0.05:
            sentences.append(
                f"The {what} seems to have oblong pixels (fx {lens.fx_px:.0f}, fy {lens.fy_px:.0f} px). Check"
                " that the printed squares are square and, for the projector, its size."
            )
    if found.rms_px > GOOD_RMS_PX:
        sentences.append(
            f"The reprojection error of {found.rms_px:.2f} px is large. Check that the board is flat and was"
            " still during each pose."
        )
    if tilt_deg < GOOD_TILT_DEG:
        sentences.append(
            f"The board was tilted by {tilt_deg:.0f} degrees at most. Tilt it by {GOOD_TILT_DEG:.0f} to 45."
        )
    return sentences + implausible(found) + _size_doubt(found, baseline_mm)


def _k3(lens: Lens, deviation: LensDeviation) -> str:
    """The term that is known least, in words; empty where it is held at zero."""
    std = deviation.distortion[4]
    return f" (k3 {with_std(lens.distortion[4], std, 2)})" if std else ""


def _most_corner_px(found: GeometryCalibration, lens: Lens) -> float:
    """What the distortion of one of the lenses may leave open in a corner, px of its picture."""
    seen_px = lens.fx_px / found.camera.fx_px
    return MAX_CORNER_PX if lens is found.camera else max(MAX_CORNER_PX, CORNER_SHARE * seen_px)


def _corner_px(found: GeometryCalibration, lens: Lens, first: int) -> float:
    """What the radial distortion (k1, k2, k3) leaves open in the farthest corner of a picture, px.

    ``first`` is where the lens begins among the parameters of the covariance.
    """
    if found.covariance is None:
        return 0.0
    side = round(len(found.covariance) ** 0.5)
    radial = [first + 4, first + 5, first + 8]
    covariance = np.array(found.covariance).reshape(side, side)[np.ix_(radial, radial)]
    across = max(lens.cx_px, lens.width_px - 1 - lens.cx_px) / lens.fx_px
    down = max(lens.cy_px, lens.height_px - 1 - lens.cy_px) / lens.fy_px
    radius = float(np.hypot(across, down))
    slope = lens.fx_px * radius ** np.array([3, 5, 7])
    return float(np.sqrt(slope @ covariance @ slope))


def _size_doubt(found: GeometryCalibration, baseline_mm: float | None) -> list[str]:
    """The size of the squares scales all lengths, so that only another known length can show an error."""
    distance = float(np.linalg.norm(found.pose.translation_mm))
    if baseline_mm is None or abs(distance / baseline_mm - 1) <= 0.1:
        return []
    size = found.board.square_mm * baseline_mm / distance
    return [
        f"The fit puts camera and projector {distance:.0f} mm apart, but {baseline_mm:.0f} mm were measured:"
        f" the printed squares are probably {size:.1f} mm, not {found.board.square_mm:g} mm. Measure them."
    ]
