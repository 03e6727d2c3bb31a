"""Many poses of a board: what each shows, which cannot be used and why, and what is doubtful about them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

from dsl_core.calibration.geometry.code_model import code_light
from dsl_core.calibration.geometry.diagnosis import MIN_POSES, exposure_warning
from dsl_core.calibration.geometry.projector_corners import PoseObservation, observe_pose
from dsl_core.errors import CalibrationError
from dsl_core.model.board import Board
from dsl_core.model.calibration.geometry import LeftOut
from dsl_core.model.calibration.pose_frames import PoseFrames

#: A pose is blurred when its edges are this many times as wide as those of the others, and so wide (px).
BLURRED, LEAST_BLUR_PX = 2.0, 0.8
#: Pictures are linear when half the light reads as half the value; gammas farther from 1 are told.
GAMMA_TOLERANCE = 0.15
#: Pixels whose pattern and inverse differ by less than this share see half the light in each.
HALF_LIT, LEAST_PIXELS = 0.15, 200


@dataclass
class PoseSeries:
    """The poses that can be used, those that cannot, and warnings that name a pose."""

    seen: list[PoseObservation] = field(default_factory=list)
    left_out: list[LeftOut] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)


def observe_series(
    poses: Iterable[PoseFrames], board: Board, projector_size_px: tuple[int, int]
) -> PoseSeries:
    """Look at one pose after the other, and go on without those whose board or code cannot be read.

    Raises `CalibrationError` with the reasons when fewer than three are left. What the iterable raises (such
    as pictures that are missing) ends the series.
    """
    found = PoseSeries()
    gammas = []
    for frames in poses:
        try:
            pose = observe_pose(frames, board, projector_size_px)
        except CalibrationError as error:
            found.left_out.append(LeftOut(name=frames.name, reason=str(error)))
            continue
        found.seen.append(pose)
        gammas.append(picture_gamma(frames, projector_size_px))
        found.warnings += [doubt for doubt in [exposure_warning(frames, pose)] if doubt]
    if found.left_out and len(found.seen) < MIN_POSES:
        reasons = " ".join(each.reason for each in found.left_out)
        raise CalibrationError(
            f"Only {len(found.seen)} of {len(found.seen) + len(found.left_out)} poses can be used,"
            f" {MIN_POSES} are needed. {reasons}"
        )
    found.warnings += [f"{each.name} is left out: {each.reason}" for each in found.left_out]
    found.warnings += _blurred(found.seen) + _bent(np.array(gammas))
    return found


def _blurred(seen: list[PoseObservation]) -> list[str]:
    typical = float(np.median([pose.blur_px for pose in seen])) if seen else 0.0
    return [
        f"{pose.name} is blurred: its edges are {pose.blur_px:.1f} px wide, those of the other poses"
        f" {typical:.1f} px. Focus, hold the board still, and take the pose again."
        for pose in seen
        if pose.blur_px > max(BLURRED * typical, LEAST_BLUR_PX)
    ]


def picture_gamma(frames: PoseFrames, projector_size_px: tuple[int, int]) -> float:
    """From light to the value of a pixel: the exponent, 1 for a linear camera; NaN where nothing tells.

    Where the edges of the finest stripes cross a pixel, it gets half of white's light from the pattern and
    from its inverse, so that their sum over white is ``2 * 0.5**gamma``.
    """
    columns, _ = code_light(frames, projector_size_px)
    pair = (projector_size_px[0] - 1).bit_length() - 1
    one, other, white, black = (
        np.asarray(p, np.float32)
        for p in (frames.pairs[2 * pair], frames.pairs[2 * pair + 1], frames.white, frames.black)
    )
    if one.ndim == 3:
        one, other, white, black = (p.mean(2) for p in (one, other, white, black))
    half = (columns.weight > 0) & (np.abs(columns.contrast[-1]) < HALF_LIT)
    half &= white - black > 0.3 * np.quantile(white - black, 0.99)
    if half.sum() < LEAST_PIXELS:
        return float("nan")
    ratio = float(np.median((one + other - 2 * black)[half] / (white - black)[half]))
    return 1 - float(np.log2(max(ratio, 1e-3)))


def _bent(gammas: np.ndarray[tuple[int], np.dtype[np.float64]]) -> list[str]:
    known = gammas[np.isfinite(gammas)]
    if not len(known) or abs(np.median(known) - 1) <= GAMMA_TOLERANCE:
        return []
    return [
        f"The pictures are not linear: half the light reads like a gamma of {np.median(known):.2f}. Switch"
        " off the camera's gamma and the projector's dynamic contrast, which shift corners and bits."
    ]
