"""Lenses and pose refined by a flat target at known steps of a stage.

A board gives few, well known points; a plane under the binary code and lines gives a column at every pixel,
at a hundredth of a pixel. What the board leaves uncertain is moved, within its covariance, until the
points of every position lie on a plane, the planes are parallel, and their distances are those of the stage.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsl_core.calibration.bundle import CAMERA, PROJECTOR, SHARED, STEREO
from dsl_core.calibration.geometric import lens_of, pose_of
from dsl_core.calibration.stage_planes import (
    DISTANCE,
    SLOPES,
    STEPS,
    StageProblem,
    columns_at,
    plane_of,
    rays_through,
)
from dsl_core.calibration.tiles import ColumnSamples
from dsl_core.errors import CalibrationError
from dsl_core.model.rig import Rig
from dsl_core.optics.shading import Plane

Floats = NDArray[np.float64]

ROUNDS = 12
#: Residuals beyond this many deviations weigh less (Huber).
HUBER_SIGMAS = 2.5
#: Tile means are never better than this: lens models leave as much (px).
FLOOR_PX = 0.002
#: Tiles a position needs.
MIN_TILES = 30
#: What a stage or a plane may be off (mm) before it is taken as wrong, and by how much a stage's scale.
MAX_STEP_ERROR_MM, MAX_PLANE_RMS_MM, MAX_SCALE_ERROR = 0.3, 0.3, 0.02


@dataclass(frozen=True)
class PlaneRefinement:
    """The refined rig, the plane of every position, and how well all agree.

    ``plane_rms_mm`` is the scatter of the points of each position about its plane (the 95 % nearest to it),
    ``step_error_mm`` how far each position is from where the stage says, with its deviation. ``covariance``
    (24, 24) is that of the refined lenses and pose; ``column_std_px`` is what it means for zero-order columns
    and ``depth_std_mm`` for depths, rms over the image and the range of depth.
    """

    rig: Rig
    planes: tuple[Plane, ...]
    plane_rms_mm: Floats
    residual_rms_px: Floats
    step_error_mm: Floats
    step_std_mm: Floats
    covariance: Floats
    column_std_px: float
    depth_std_mm: float


def refine_planes(
    rig: Rig,
    positions_mm: Sequence[float],
    samples: Sequence[ColumnSamples],
    covariance: Floats | None,
    stage_std_mm: float,
) -> PlaneRefinement:
    """Refine lenses and pose of ``rig``, whose covariance (24, 24) is the prior; None keeps them.

    ``positions_mm`` are what the stage reported, ``samples`` the tile means of each position. Raises
    `CalibrationError` that names the position whose plane is not flat, or whose step is not what was asked.
    """
    _require_tiles(positions_mm, samples)
    start = _start(rig, positions_mm, samples, stage_std_mm)
    problem = StageProblem(rig, positions_mm, samples, covariance, stage_std_mm)
    free = np.arange(SHARED if covariance is None else 0, len(start))
    numbers, posterior = _gauss_newton(problem, start, free)
    found = _summary(rig, problem, numbers, posterior)
    _require_flat(positions_mm, found)
    return found


def _gauss_newton(
    problem: StageProblem, start: Floats, free: NDArray[np.int64], prior: bool = True
) -> tuple[Floats, Floats]:
    """Numbers that fit best and their covariance, robust, with residuals setting the scale of the noise."""
    numbers = start.copy()
    sigma = np.hypot(problem.std_px, FLOOR_PX)
    pull = problem.prior_weight[free] * prior
    information = np.eye(len(free))
    for _ in range(ROUNDS):
        residual = problem.residual_px(numbers)
        jacobian = problem.jacobian(numbers, free)
        scale = max(1.0, 1.4826 * float(np.median(np.abs(residual / sigma))))
        off = np.abs(residual) / (scale * sigma)
        weight = np.minimum(1.0, HUBER_SIGMAS / np.maximum(off, 1e-12)) / (scale * sigma) ** 2
        information = (jacobian * weight[:, None]).T @ jacobian + np.diag(pull**2)
        gradient = jacobian.T @ (weight * residual) - pull**2 * numbers[free]
        size = np.sqrt(np.diag(information).clip(1e-30))
        step = np.linalg.lstsq(information / np.outer(size, size), gradient / size, rcond=1e-13)[0] / size
        numbers[free] += step
        if np.abs(step * size).max() < 1e-2:
            break
    covariance = np.zeros((len(numbers), len(numbers)))
    inverse = np.linalg.pinv(information / np.outer(size, size), hermitian=True) / np.outer(size, size)
    covariance[np.ix_(free, free)] = inverse
    return numbers, covariance


def _start(
    rig: Rig, positions_mm: Sequence[float], samples: Sequence[ColumnSamples], stage_std_mm: float
) -> Floats:
    """Plane of each position for itself under the geometry given; checks the steps between them."""
    slopes, distances = [], []
    for part in samples:
        alone = StageProblem(rig, [0.0], [part], None, stage_std_mm)
        numbers = np.zeros(STEPS + 1)
        numbers[DISTANCE] = np.mean(rig.depth_range_mm)
        # First the distance alone: from far off, slopes would run away.
        for free in ([DISTANCE], [SHARED, SHARED + 1, DISTANCE]):
            numbers, _ = _gauss_newton(alone, numbers, np.array(free), prior=False)
        slopes.append(numbers[SLOPES])
        distances.append(float(numbers[DISTANCE]))
    _require_steps(positions_mm, np.array(distances))
    start = np.zeros(STEPS + len(samples))
    start[SLOPES] = np.mean(slopes, 0)
    steps = np.asarray(positions_mm) - positions_mm[0]
    start[DISTANCE] = np.median(np.array(distances) - steps)
    return start


def _summary(rig: Rig, problem: StageProblem, numbers: Floats, posterior: Floats) -> PlaneRefinement:
    shared = problem.shared(numbers)
    covariance = problem.root @ posterior[:SHARED, :SHARED] @ problem.root.T
    camera, projector = rig.camera, rig.projector
    refined = rig.model_copy(
        update={
            "camera": lens_of(shared[CAMERA], (camera.width_px, camera.height_px)),
            "projector": lens_of(shared[PROJECTOR], (projector.width_px, projector.height_px)),
            "pose": pose_of(shared[STEREO]),
        }
    )
    residual = problem.residual_px(numbers)
    points = problem.points_mm(numbers)
    # Pixels of column that a millimetre of depth moves the point.
    slope = columns_at(shared, points * (1 + 0.5 / points[2])) - columns_at(
        shared, points * (1 - 0.5 / points[2])
    )
    each = [problem.position_of == k for k in range(len(problem.steps_mm))]
    column_std, depth_std = systematic_std(refined, shared, problem.root, posterior[:SHARED, :SHARED])
    distances = problem.distances_mm(numbers)
    return PlaneRefinement(
        rig=refined,
        planes=tuple(plane_of(numbers[SLOPES], float(d)) for d in distances),
        plane_rms_mm=np.array([_rms(residual[part] / slope[part]) for part in each]),
        residual_rms_px=np.array([_rms(residual[part]) for part in each]),
        step_error_mm=numbers[STEPS:] - numbers[STEPS:].mean(),
        step_std_mm=np.sqrt(np.diag(posterior)[STEPS:].clip(0)),
        covariance=covariance,
        column_std_px=column_std,
        depth_std_mm=depth_std,
    )


def systematic_std(rig: Rig, shared: Floats, root: Floats, posterior: Floats) -> tuple[float, float]:
    """Deviation of zero-order columns (px) and of depth (mm) that the uncertainty of the geometry leaves.

    Root mean square over the image and over the rig's range of depth; ``root @ w`` moves the parameters, with
    the covariance ``posterior`` of w.
    """
    x, y = np.meshgrid(
        np.linspace(0, rig.camera.width_px - 1, 12), np.linspace(0, rig.camera.height_px - 1, 8)
    )
    pixels = np.stack([x.ravel(), y.ravel()], 1)
    depths = np.linspace(*rig.depth_range_mm, 5)

    def columns(numbers: Floats, more_mm: float = 0.0) -> Floats:
        rays = rays_through(numbers[CAMERA], pixels)
        return np.concatenate([columns_at(numbers, rays * (z + more_mm)) for z in depths])

    moves = [columns(shared + 1e-3 * root[:, k]) - columns(shared - 1e-3 * root[:, k]) for k in range(SHARED)]
    jacobian = np.stack(moves, 1) / 2e-3
    variance = np.einsum("nk,kl,nl->n", jacobian, posterior, jacobian)
    slope = columns(shared, 0.5) - columns(shared, -0.5)
    seen = columns(shared)
    inside = (seen > -0.5) & (seen < rig.projector.width_px - 0.5)
    return float(np.sqrt(variance[inside].mean())), float(np.sqrt((variance / slope**2)[inside].mean()))


def _rms(values: Floats) -> float:
    # Tiles at the rim of the light are few and far off; the middle 95 % tell what the plane is like.
    limit = np.percentile(np.abs(values), 95)
    return float(np.sqrt(np.mean(values[np.abs(values) <= limit] ** 2)))


def _require_tiles(positions_mm: Sequence[float], samples: Sequence[ColumnSamples]) -> None:
    if len(samples) < 2:
        raise CalibrationError(
            f"The depth stage needs a plane at two or more positions, given {len(samples)}. Add positions."
        )
    for position, part in zip(positions_mm, samples, strict=True):
        if len(part) < MIN_TILES:
            raise CalibrationError(
                f"At the stage's position {position:g} mm only {len(part)} tiles of the image show"
                f" columns of the projector; {MIN_TILES} are needed. Check that the plane fills the view."
            )


def _require_steps(positions_mm: Sequence[float], distances_mm: Floats) -> None:
    """Raise `CalibrationError` unless the planes stand as far apart as the stage says."""
    positions = np.asarray(positions_mm, float)
    # The step that all pairs agree on: one wrong position spoils only its own pairs.
    first, second = np.triu_indices(len(positions), 1)
    scales = (distances_mm[second] - distances_mm[first]) / (positions[second] - positions[first])
    scale = float(np.median(scales))
    offset = np.median(distances_mm - scale * positions)
    off = distances_mm - scale * positions - offset
    worst = int(np.abs(off).argmax())
    if len(positions) > 2 and np.abs(off[worst]) > MAX_STEP_ERROR_MM + 0.002 * np.ptp(positions):
        raise CalibrationError(
            f"The plane at the stage's position {positions[worst]:g} mm stands {off[worst]:+.2f} mm from"
            " where the other positions say it should. Check that the stage reached it and that nothing else"
            " moved, and take this position again."
        )
    if abs(scale - 1) > MAX_SCALE_ERROR:
        raise CalibrationError(
            f"The planes are {scale:.3f} times as far apart as the stage's positions"
            f" {', '.join(f'{p:g}' for p in positions)} mm. Check the unit of the stage, that it moves along"
            " the camera's axis, and the printed size of the board that the geometry was calibrated with."
        )


def _require_flat(positions_mm: Sequence[float], found: PlaneRefinement) -> None:
    worst = int(found.plane_rms_mm.argmax())
    if found.plane_rms_mm[worst] > MAX_PLANE_RMS_MM:
        raise CalibrationError(
            f"The points at the stage's position {positions_mm[worst]:g} mm lie"
            f" {found.plane_rms_mm[worst]:.2f} mm rms off a plane; {MAX_PLANE_RMS_MM:g} mm are allowed. Use a"
            " flat target that fills the view, and check that all positions were captured with this rig."
        )
