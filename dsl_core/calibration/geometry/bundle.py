"""Joint least squares of two lenses, their pose to each other and the poses of a board before them.

Zhang, "A flexible new technique for camera calibration" (PAMI 2000), for a camera and a projector that share
the poses of the board. Derivatives are analytic: those of the lens by OpenCV, those of the motions here.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsl_core.calibration.geometry.projector_corners import PoseObservation
from dsl_core.errors import CalibrationError
from dsl_core.model.board import Board
from dsl_core.model.calibration.geometry import Flatness
from dsl_core.solve.robust import robust_std

Floats = NDArray[np.float64]

#: fx, fy, cx, cy, k1, k2, p1, p2, k3.
LENS = 9
#: Both lenses and the pose between them (rotation vector, translation) come before the poses of the board.
SHARED = 2 * LENS + 6
#: Corners farther off than this many robust deviations are not on the plane of the board, or are misread.
OUTLIER_SIGMAS, MAX_ROUNDS = 4.0, 12
#: A corner nearer than this (px) is never left out, only weighed less: errors that small do no harm, however
#: sharp all other corners are.
HARMLESS_PX = 0.08
#: Before that, corners weigh less the farther off they are, from this many deviations on.
CAUCHY_SIGMAS, ROBUST_ROUNDS = 2.0, 3
#: Deviations stated over those that the scatter of corners explains: eight drawn rigs with noise, 145 rows of
#: pixels, came out 1.18 times as far off.
MARGIN = 1.2
#: A board bends in waves no shorter than a polynomial of this degree has over it.
BOW_DEGREE = 3
#: Terms of the distortion that can be held at zero, and their places in a lens.
TERMS = {"k1": (4,), "k2": (5,), "tangential": (6, 7), "k3": (8,)}
CAMERA, PROJECTOR, STEREO = slice(0, LENS), slice(LENS, 2 * LENS), slice(2 * LENS, SHARED)


@dataclass(frozen=True)
class Adjustment:
    """The fitted parameters with their covariance, and the residuals (px) of every corner.

    ``parameters`` holds both lenses (9 each), the pose between them (rotation vector, mm) and 6 numbers a
    board pose. Residuals are predicted minus seen, (corners, 2); ``used`` marks all but outliers.
    """

    parameters: Floats
    covariance: Floats
    camera_residual_px: Floats
    projector_residual_px: Floats
    used: NDArray[np.bool_]


class Prior(NamedTuple):
    """What is known of the parameter of a number before any corner is seen: its value and deviation."""

    number: int
    value: float
    std: float


class Problem:
    """Corners of all poses in one array each, and their residuals with derivatives.

    Rows of the projector that are not known (NaN) have no residual.
    """

    def __init__(
        self, poses: Sequence[PoseObservation], held: Collection[int] = (), priors: Sequence[Prior] = ()
    ) -> None:
        """Collect the corners; parameters of the numbers ``held`` keep their value."""
        self._held = list(held)
        self.priors = tuple(priors)
        self.board_mm = np.concatenate([pose.board_mm for pose in poses])
        self.camera_px = np.concatenate([pose.camera_px for pose in poses])
        seen_px = np.concatenate([pose.projector_px for pose in poses])
        self._unseen = np.isnan(seen_px)
        self.projector_px = np.where(self._unseen, 0.0, seen_px)
        self.slopes = np.concatenate([pose.slopes for pose in poses])
        self.pose_of = np.repeat(np.arange(len(poses)), [len(pose.ids) for pose in poses])

    def evaluate(self, parameters: Floats) -> tuple[Floats, Floats, Floats, Floats]:
        """Residuals (corners, 2) of camera and projector, and their derivatives (corners, 2, parameters).

        Those of the projector are without what the camera's errors bring into them: what is left is how well
        the code fits at the pixels themselves, which is known far better than where a corner is.
        """
        boards = parameters[SHARED:].reshape(-1, 6)
        in_camera, by_board = move(boards[self.pose_of], self.board_mm)
        camera, by_lens, by_point = project(parameters[CAMERA], in_camera)
        camera_jac = np.zeros((len(camera), 2, len(parameters)))
        camera_jac[:, :, CAMERA] = by_lens
        self._put_boards(camera_jac, by_point @ by_board)
        stereo = np.broadcast_to(parameters[STEREO], (len(camera), 6))
        in_projector, by_stereo = move(stereo, in_camera)
        projector, by_lens, by_point = project(parameters[PROJECTOR], in_projector)
        projector_jac = np.zeros_like(camera_jac)
        projector_jac[:, :, PROJECTOR] = by_lens
        projector_jac[:, :, STEREO] = by_point @ by_stereo
        rotation = rotation_of(parameters[STEREO][:3])
        self._put_boards(projector_jac, by_point @ (rotation @ by_board))
        camera_residual = camera - self.camera_px
        projector_residual = projector - self.projector_px - self.carried(camera_residual)
        projector_jac -= np.einsum("nij,njp->nip", self.slopes, camera_jac)
        camera_jac[:, :, self._held] = projector_jac[:, :, self._held] = 0
        projector_residual[self._unseen] = projector_jac[self._unseen] = 0
        return camera_residual, projector_residual, camera_jac, projector_jac

    def carried(self, camera_residual: Floats) -> Floats:
        """What errors of corners in the camera picture are on the projector, (corners, 2)."""
        return np.asarray(np.einsum("nij,nj->ni", self.slopes, camera_residual))

    def _put_boards(self, jacobian: Floats, by_board: Floats) -> None:
        columns = SHARED + 6 * self.pose_of[:, None] + np.arange(6)
        np.put_along_axis(jacobian, columns[:, None, :].repeat(2, 1), by_board, 2)


def rotation_of(vector: Floats) -> Floats:
    """Rotation matrix (3, 3) of a rotation vector (axis times angle)."""
    import cv2

    return np.asarray(cv2.Rodrigues(np.asarray(vector, np.float64).reshape(3, 1))[0], np.float64)


def vector_of(rotation: Floats) -> Floats:
    """Rotation vector (3,) of a rotation matrix."""
    import cv2

    return np.asarray(cv2.Rodrigues(np.asarray(rotation, np.float64))[0], np.float64).ravel()


def move(motions: Floats, points: Floats) -> tuple[Floats, Floats]:
    """Points (n, 3) moved by motions (n, 6), and the derivative by the motion, (n, 3, 6)."""
    import cv2

    # Points of a pose follow each other.
    new = np.append(True, (motions[1:] != motions[:-1]).any(1))
    which = np.cumsum(new) - 1
    turned = [cv2.Rodrigues(motion[:3].copy().reshape(3, 1)) for motion in motions[new]]
    rotations = np.array([rotation for rotation, _ in turned])[which]
    # OpenCV: row k is the derivative of the matrix, row by row, by component k of the vector.
    slopes = np.array([slope.reshape(3, 3, 3) for _, slope in turned])[which]
    moved = np.einsum("nij,nj->ni", rotations, points) + motions[:, 3:]
    by_motion = np.empty((len(points), 3, 6))
    by_motion[:, :, :3] = np.einsum("nkij,nj->nik", slopes, points)
    by_motion[:, :, 3:] = np.eye(3)
    return moved, by_motion


def project(lens: Floats, points: Floats) -> tuple[Floats, Floats, Floats]:
    """Pixels (n, 2) of points (n, 3), and derivatives by the lens (n, 2, 9) and by the point (n, 2, 3)."""
    import cv2

    matrix = np.array([[lens[0], 0, lens[2]], [0, lens[1], lens[3]], [0, 0, 1]])
    zero = np.zeros((3, 1))
    pixels, slopes = cv2.projectPoints(np.ascontiguousarray(points), zero, zero, matrix, lens[4:].copy())
    jacobian = np.asarray(slopes, np.float64).reshape(len(points), 2, -1)
    return np.asarray(pixels, np.float64).reshape(-1, 2), jacobian[:, :, 6:15], jacobian[:, :, 3:6]


def adjust(
    poses: Sequence[PoseObservation],
    start: Floats,
    held: Collection[int] = (),
    priors: Sequence[Prior] = (),
) -> Adjustment:
    """Minimise the weighted squares of all corners, first with robust weights, then without the outliers.

    Parameters of the numbers ``held`` stay as in ``start``, with no deviation; ``priors`` draw theirs. Camera
    and projector are weighted by their own noise, estimated from the residuals. Raises `CalibrationError`
    when the fit does not converge.
    """
    problem = Problem(poses, held, priors)
    parameters, one = start, np.ones(2)
    for _ in range(ROBUST_ROUNDS):
        far, _ = _farthest(problem, parameters, np.ones(len(problem.pose_of), bool))
        parameters = _solve(problem, parameters, (one, one), 1 / (1 + (far / CAUCHY_SIGMAS) ** 2))
    used = np.ones(len(problem.pose_of), bool)
    for _ in range(MAX_ROUNDS):
        sigmas = _noises(problem, parameters, used)
        weights = _weights(problem, parameters, used)
        before, used = used, weights > 0
        if 4 * used.sum() <= len(parameters):
            raise CalibrationError(
                "Camera and projector do not fit one board: most corners are outliers. Check the number of"
                " corners of the board, the projector's size, and that nothing moved during a pose."
            )
        parameters = _solve(problem, parameters, sigmas, weights)
        if np.array_equal(before, used):
            break
    return _summary(problem, parameters, weights, sigmas)


def refit(
    poses: Sequence[PoseObservation],
    start: Floats,
    held: Collection[int] = (),
    priors: Sequence[Prior] = (),
) -> Floats:
    """Parameters for other poses of the same rig, without their outliers, from a start that is close."""
    problem = Problem(poses, held, priors)
    everything = np.ones(len(problem.pose_of), bool)
    sigmas = _noises(problem, start, everything)
    return _solve(problem, start, sigmas, _weights(problem, start, everything))


def _solve(problem: Problem, start: Floats, sigmas: tuple[Floats, Floats], weights: Floats) -> Floats:
    """Levenberg and Marquardt for weighted corners."""
    from scipy.optimize import least_squares

    root = np.sqrt(weights)[:, None]
    known = np.zeros((len(problem.priors), len(start)))
    for row, prior in zip(known, problem.priors, strict=True):
        row[prior.number] = 1 / prior.std

    # MINPACK asks for the derivatives where it last asked for the residuals.
    last: dict[bytes, tuple[Floats, Floats, Floats, Floats]] = {}

    def evaluated(parameters: Floats) -> tuple[Floats, Floats, Floats, Floats]:
        key = parameters.tobytes()
        if key not in last:
            last.clear()
            last[key] = problem.evaluate(parameters)
        return last[key]

    def residuals(parameters: Floats) -> Floats:
        camera, projector, _, _ = evaluated(parameters)
        off = [(parameters[prior.number] - prior.value) / prior.std for prior in problem.priors]
        both = [(camera * root / sigmas[0]).ravel(), (projector * root / sigmas[1]).ravel()]
        return np.concatenate([*both, off])

    def jacobian(parameters: Floats) -> Floats:
        _, _, camera, projector = evaluated(parameters)
        scales = [root[:, None] / sigma[:, None] for sigma in sigmas]
        both = [camera * scales[0], projector * scales[1]]
        return np.concatenate([np.concatenate(both).reshape(-1, len(parameters)), known])

    fit = least_squares(residuals, start, jac=jacobian, method="lm", x_scale="jac", max_nfev=200)
    if not np.isfinite(fit.x).all():
        raise CalibrationError("The joint fit of camera and projector did not converge. Capture more poses.")
    return np.asarray(fit.x, np.float64)


def _noises(problem: Problem, parameters: Floats, used: NDArray[np.bool_]) -> tuple[Floats, Floats]:
    camera, projector, _, _ = problem.evaluate(parameters)
    return _noise(camera[used]), _noise(projector[used])


def _farthest(problem: Problem, parameters: Floats, used: NDArray[np.bool_]) -> tuple[Floats, Floats]:
    """Largest of the four errors of every corner: in robust standard deviations of the used ones, and px."""
    camera, projector, _, _ = problem.evaluate(parameters)
    sigmas = [(np.abs(each) / _noise(each[used])).max(1) for each in (camera, projector)]
    pixels = [np.abs(each).max(1) for each in (camera, projector)]
    return np.asarray(np.maximum(*sigmas)), np.asarray(np.maximum(*pixels))


def _weights(problem: Problem, parameters: Floats, used: NDArray[np.bool_]) -> Floats:
    """Weights of the corners: zero for outliers, less than one beyond the limit where that is harmless."""
    sigmas, pixels = _farthest(problem, parameters, used)
    kept = (sigmas <= OUTLIER_SIGMAS) | (pixels <= HARMLESS_PX)
    return np.where(kept, np.minimum(1.0, OUTLIER_SIGMAS / np.maximum(sigmas, 1e-12)), 0.0)


def _summary(
    problem: Problem, parameters: Floats, weights: Floats, sigmas: tuple[Floats, Floats]
) -> Adjustment:
    """The fit with its covariance, which allows for the errors of a corner being correlated.

    Where a board is badly printed or not flat, all errors of a corner go together: the covariance sums over
    corners, not over coordinates (Huber's sandwich).
    """
    camera, projector, camera_jac, projector_jac = problem.evaluate(parameters)
    used = weights > 0
    root = np.sqrt(weights[used])
    errors = np.concatenate([camera / sigmas[0], projector / sigmas[1]], 1)[used] * root[:, None]
    slopes = np.concatenate([camera_jac / sigmas[0][:, None], projector_jac / sigmas[1][:, None]], 1)[used]
    slopes *= root[:, None, None]
    rows = slopes.reshape(-1, len(parameters))
    stated = np.zeros(len(parameters))
    for prior in problem.priors:
        stated[prior.number] = prior.std**-2
    scale = np.sqrt((rows**2).sum(0) + stated)
    is_held = scale == 0
    scale[is_held] = 1
    square = (rows / scale).T @ (rows / scale) + np.diag(stated / scale**2)
    inverse = np.linalg.pinv(square, hermitian=True) / np.outer(scale, scale)
    inverse[is_held] = inverse[:, is_held] = 0
    # A corner draws the fit towards itself: without it, its errors would be larger (Bell and McCaffrey 2002).
    leverage = slopes @ inverse @ slopes.swapaxes(1, 2)
    unseen = np.linalg.solve((1 + 1e-6) * np.eye(4) - leverage, errors[..., None])[..., 0]
    pulls = np.einsum("nk,nkp->np", unseen, slopes)
    covariance = inverse @ (MARGIN**2 * (pulls.T @ pulls) + np.diag(stated)) @ inverse
    return Adjustment(parameters, covariance, camera, projector + problem.carried(camera), used)


def _noise(residual: Floats) -> Floats:
    """Robust deviation of residuals (corners, 2), px, across and down; exact corners become no outliers."""
    return np.maximum(robust_std(residual, 0), 1e-4)


def triangulate(shared: Floats, seen: PoseObservation, start_mm: Floats) -> Floats:
    """Points (corners, 3) in camera coordinates, mm, whose images are nearest to those seen, in pixels.

    ``shared`` are the parameters of lenses and pose (see `bundle`). Gauss and Newton from ``start_mm``; the
    board itself is not used.
    """
    points = start_mm
    stereo = np.broadcast_to(shared[STEREO], (len(points), 6))
    for _ in range(10):
        camera, _, camera_slope = project(shared[CAMERA], points)
        in_projector, _ = move(stereo, points)
        projector, _, projector_slope = project(shared[PROJECTOR], in_projector)
        # The rotation between the devices, column by column, is what moving a point by one unit does.
        turn = move(stereo[:3], np.eye(3))[0] - shared[STEREO][3:]
        slope = np.concatenate([camera_slope, projector_slope @ turn.T], 1)
        error = np.concatenate([camera - seen.camera_px, projector - seen.projector_px], 1)
        unseen = np.isnan(error)
        error[unseen] = slope[unseen] = 0
        square = np.swapaxes(slope, 1, 2)
        step = np.linalg.solve(square @ slope, square @ error[:, :, None])[:, :, 0]
        points = points - step
        if np.abs(step).max() < 1e-6 * np.abs(points).max():
            break
    return points


def flatness(points_mm: Floats, ids: NDArray[np.int64], board: Board) -> Flatness:
    """Sides of all squares whose corners were seen, rms distance from the best plane, and rms of its bow."""
    sides = _sides(points_mm, ids, board)
    around = points_mm - points_mm.mean(0)
    _, lengths, axes = np.linalg.svd(around, full_matrices=False)
    return Flatness(
        square_mm=float(sides.mean()),
        square_std_mm=float(sides.std()),
        plane_rms_mm=float(lengths[2] / np.sqrt(len(points_mm))),
        bow_rms_mm=_bow_rms_mm(around @ axes.T),
    )


def _bow_rms_mm(around: Floats) -> float | None:
    """Rms of the smooth part of what points (n, 3), third axis across their plane, are off it.

    Corners that are off by noise alone would have a little of it; that is taken off.
    """
    scale = np.abs(around[:, :2]).max()
    x, y = around[:, :2].T / max(scale, 1e-9)
    terms = np.stack([x**i * y**j for i in range(BOW_DEGREE + 1) for j in range(BOW_DEGREE + 1 - i)], 1)
    free = len(around) - terms.shape[1]
    if free < terms.shape[1]:
        return None
    fitted = terms @ np.linalg.lstsq(terms, around[:, 2], rcond=None)[0]
    noise = float(np.square(around[:, 2] - fitted).sum() / free)
    # The plane itself has three of the terms.
    by_noise = noise * (terms.shape[1] - 3) / len(around)
    return float(np.sqrt(max(float(np.square(fitted).mean()) - by_noise, 0.0)))


def _sides(points_mm: Floats, ids: NDArray[np.int64], board: Board) -> Floats:
    columns, rows = board.corner_grid
    known = np.full((rows * columns, 3), np.nan)
    known[ids] = points_mm
    grid = known.reshape(rows, columns, 3)
    sides = [np.linalg.norm(np.diff(grid, axis=axis), axis=-1).ravel() for axis in (0, 1)]
    joined = np.concatenate(sides)
    return np.asarray(joined[np.isfinite(joined)])
