"""Whether the camera was knocked, or its zoom or focus touched, between two poses of the board.

Each pose has its own place of the board, which takes up what the camera's picture shifted by. The projector,
whose pattern lights the same board, did not turn with it: seen from there, all boards before and after are
apart, and no place of theirs explains that.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsl_core.calibration.geometry.bundle import CAMERA, Problem
from dsl_core.calibration.geometry.projector_corners import PoseObservation
from dsl_core.solve.robust import robust_std

Floats = NDArray[np.float64]

#: By how much the misfit has to fall, in variances of what a corner is off by, and the least motion, px.
GAIN, LEAST_PX = 60.0, 0.12
#: Shift across, shift down, and zoom.
MOTIONS = 3
#: Corners are not used that are so many deviations off.
FAR = 6.0


@dataclass(frozen=True)
class Knock:
    """The picture of the camera moved by ``shift_px`` (across, down) and grew by ``zoom`` before a pose."""

    before: str
    after: str
    shift_px: tuple[float, float]
    zoom: float
    rms_px: float
    gain: float

    @property
    def sentence(self) -> str:
        """What is wrong, and what to do."""
        return (
            f"Between {self.before} and {self.after} the camera seems to have moved against the projector, or"
            f" its zoom or focus to have changed: its picture by {self.rms_px:.2f} px (rms), of which"
            f" {self.shift_px[0]:+.2f} px across, {self.shift_px[1]:+.2f} px down, and {self.zoom:+.2%} in"
            " size. Fix both devices, lock zoom and focus, and capture all poses again."
        )


def knocked(poses: Sequence[PoseObservation], parameters: Floats) -> Knock | None:
    """The motion that explains best what is left of the fit with these ``parameters``; None if none does."""
    problem = Problem(poses)
    camera, projector, camera_jac, projector_jac = problem.evaluate(parameters)
    sigmas = [np.maximum(robust_std(each, 0), 1e-4) for each in (camera, projector)]
    errors = np.concatenate([camera / sigmas[0], projector / sigmas[1]], 1)
    slopes = np.concatenate([camera_jac / sigmas[0][:, None], projector_jac / sigmas[1][:, None]], 1)
    moved = _motions(problem, parameters)
    seen = np.concatenate(
        [moved / sigmas[0][:, None], -np.einsum("nij,njm->nim", problem.slopes, moved) / sigmas[1][:, None]],
        1,
    )
    told = ~np.isnan(np.concatenate([pose.projector_px for pose in poses]))
    used = np.concatenate([np.ones_like(told), told], 1) & (np.abs(errors).max(1) < FAR)[:, None]
    found = [_between(poses, problem, k, (errors, slopes, seen, moved), used) for k in range(1, len(poses))]
    best = max((each for each in found if each is not None), key=lambda each: each.gain, default=None)
    return best if best is not None and best.gain > GAIN and best.rms_px > LEAST_PX else None


def _motions(problem: Problem, parameters: Floats) -> Floats:
    """By how much each corner moves (corners, 2, motions) per px of shift, and per unit of zoom."""
    centre = parameters[CAMERA][2:4]
    moved = np.zeros((len(problem.camera_px), 2, MOTIONS))
    moved[:, 0, 0] = moved[:, 1, 1] = 1.0
    moved[:, :, 2] = problem.camera_px - centre
    return moved


def _between(
    poses: Sequence[PoseObservation],
    problem: Problem,
    k: int,
    parts: tuple[Floats, Floats, Floats, Floats],
    used: NDArray[np.bool_],
) -> Knock | None:
    """The likeliest motion before pose ``k``; ``used`` (corners, 4) are coordinates that tell."""
    errors, slopes, seen, moved = parts
    later = problem.pose_of >= k
    rows, fitted, wanted = np.where(later[:, None, None], seen, 0.0)[used], slopes[used], errors[used]
    scale = np.maximum(np.sqrt((fitted**2).sum(0)), 1e-12)
    basis = np.linalg.qr(fitted / scale)[0]
    free, left = rows - basis @ (basis.T @ rows), wanted - basis @ (basis.T @ wanted)
    motion, *_ = np.linalg.lstsq(free, -left, rcond=None)
    rest = left + free @ motion
    variance = float(rest @ rest) / max(len(rest) - basis.shape[1] - MOTIONS, 1)
    gain = float(left @ left - rest @ rest) / variance
    by_corner = moved[later & used.any(1)] @ motion
    if not by_corner.size:
        return None
    rms_px = float(np.sqrt((by_corner**2).sum(1).mean()))
    across, down, zoom = (float(each) for each in motion)
    return Knock(poses[k - 1].name, poses[k].name, (across, down), zoom, rms_px, gain)
