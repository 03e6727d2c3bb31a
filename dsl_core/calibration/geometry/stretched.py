"""Whether the printed squares of a board are wider than high, as printers make them that stretch one way.

Poses that are all one way up say next to nothing of it: lenses with other focal lengths across than down see
the same. A pose that is turned by a right angle contradicts them, and would be taken for one that moved.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from dsl_core.calibration.geometry.bundle import CAUCHY_SIGMAS, Adjustment, Prior, Problem, adjust
from dsl_core.calibration.geometry.projector_corners import PoseObservation
from dsl_core.model.board import Board, Checkerboard
from dsl_core.solve.robust import robust_std

Floats = NDArray[np.float64]

#: By how much the misfit has to fall, in variances of what a corner is off by, and the least stretch: squares
#: of 20 mm are .04 mm wider than high, and depths off by .05 %.
GAIN, LEAST = 60.0, 0.002
ROUNDS = 20
#: Fits with a board that is stretched as the one before says: 3 % are found to a twentieth of it at once.
ADJUSTMENTS = 2
#: A step by which residuals change as good as straight.
_STEP = 1e-4


@dataclass(frozen=True)
class Stretched:
    """Squares wider than high by a ``share``, poses on such a board, and the fit to them."""

    share: float
    poses: tuple[PoseObservation, ...]
    fit: Adjustment


def stretched(
    poses: Sequence[PoseObservation],
    start: Adjustment,
    held: Collection[int] = (),
    priors: Sequence[Prior] = (),
) -> Stretched | None:
    """The poses with the stretch of the board that explains them best, None without one.

    ``start`` is the fit that takes squares for square; ``held`` and ``priors`` as in `adjust`.
    """
    share, gain = stretch_of(poses, start.parameters)
    if abs(share) < LEAST or gain < GAIN:
        return None
    fit = start
    for _ in range(ADJUSTMENTS):
        wider = tuple(with_stretch(pose, share) for pose in poses)
        fit = adjust(wider, fit.parameters, held, priors)
        found = Stretched(share, wider, fit)
        share += stretch_of(wider, fit.parameters)[0]
    return found


def stretch_of(poses: Sequence[PoseObservation], parameters: Floats) -> tuple[float, float]:
    """By what share squares are wider than high, and the misfit that this takes away, in variances.

    ``parameters`` as in `Adjustment`. Lenses and poses may move with it; poses that fit neither way count
    little.
    """
    problem = Problem(poses)
    camera, projector, camera_jac, projector_jac = problem.evaluate(parameters)
    sigmas = [np.maximum(robust_std(each, 0), 1e-4) for each in (camera, projector)]
    ahead = Problem([with_stretch(pose, _STEP) for pose in poses]).evaluate(parameters)
    errors = np.concatenate([camera / sigmas[0], projector / sigmas[1]], 1)
    by_stretch = (np.concatenate([ahead[0] / sigmas[0], ahead[1] / sigmas[1]], 1) - errors) / _STEP
    slopes = np.concatenate([camera_jac / sigmas[0][:, None], projector_jac / sigmas[1][:, None]], 1)
    rows = np.concatenate([slopes, by_stretch[..., None]], 2)
    scale = np.maximum(np.sqrt((rows**2).sum((0, 1))), 1e-12)
    rows, left = rows / scale, errors
    for _ in range(ROUNDS):
        weight = 1 / (1 + (np.abs(left).max(1) / CAUCHY_SIGMAS) ** 2)
        moved = _fitted(rows, errors, weight)
        left = errors + rows @ moved
    square = errors + rows[..., :-1] @ _fitted(rows[..., :-1], errors, weight)
    before, after = (float((weight[:, None] * each**2).sum()) for each in (square, left))
    variance = after / max(float(4 * weight.sum()) - rows.shape[2], 1.0)
    return float(moved[-1] / scale[-1]), (before - after) / max(variance, 1e-12)


def with_stretch(pose: PoseObservation, stretch: float) -> PoseObservation:
    """The pose on a board whose squares are wider than high by a share, their mean side as before."""
    return replace(pose, board_mm=pose.board_mm * np.array([1 + stretch / 2, 1 - stretch / 2, 1.0]))


def looks_turned(board: Board) -> bool:
    """Whether a board looks the same after a quarter turn: its width may be its height in another pose."""
    return isinstance(board, Checkerboard) and board.columns == board.rows


def sentence_on(stretch: float, board: Board) -> str:
    """What is wrong with the print, and what to do."""
    side_mm = board.square_mm
    wide_mm, high_mm = side_mm * (1 + stretch / 2), side_mm * (1 - stretch / 2)
    which = "wider than high" if stretch > 0 else "higher than wide"
    return (
        f"The printed squares are {abs(stretch):.2%} {which}:"
        f" {wide_mm:.3f} by {high_mm:.3f} mm if {side_mm:g} mm is the mean of both, as is assumed. Lenses and"
        " pose are fitted to such squares, but no picture tells which side was measured: measure both over"
        " many squares, and state their mean, or print the board without stretching it."
    )


def _fitted(rows: Floats, errors: Floats, weight: Floats) -> Floats:
    """The motion (n,) by which weighted ``errors`` (corners, 4) are least; ``rows`` (corners, 4, n)."""
    root = np.sqrt(weight)[:, None]
    flat = (rows * root[..., None]).reshape(-1, rows.shape[2])
    return np.asarray(np.linalg.lstsq(flat, -(errors * root).ravel(), rcond=1e-10)[0], np.float64)
