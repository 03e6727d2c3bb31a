"""Lenses and pose refined by a flat target at known steps of a stage.

A board gives few, well known points; a plane under the binary code and lines gives a column at every pixel,
at a hundredth of a pixel. What the board leaves uncertain is moved, within its covariance, until the
points of every position are on a plane, the planes are parallel, and their distances are those of the stage.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsl_core.calibration.common.tiles import ColumnSamples
from dsl_core.calibration.geometry.bundle import CAMERA, PROJECTOR, SHARED, STEREO
from dsl_core.calibration.geometry.solve import lens_of, pose_of
from dsl_core.calibration.geometry.stage_planes import (
    DISTANCE,
    SLOPES,
    STEPS,
    StageProblem,
    column_limit_px,
    columns_at,
    plane_of,
    rays_through,
    require_agreement,
    require_enough,
    require_one_angle,
    require_plane,
    require_steps,
    require_tiles,
)
from dsl_core.model.rig import Rig
from dsl_core.optics.shading import Plane
from dsl_core.solve.robust import huber_weights

Floats = NDArray[np.float64]

ROUNDS = 12
#: Residuals beyond this many deviations weigh less (Huber).
HUBER_SIGMAS = 2.5
#: Tile means are never better than this: lens models leave as much (px).
FLOOR_PX = 0.002


@dataclass(frozen=True)
class PlaneRefinement:
    """The refined rig, the plane of every position, and how well all agree.

    ``rig`` and ``planes`` are those of the fitted ``numbers`` of a ``problem``, ``posterior`` the covariance
    of these. ``plane_rms_mm`` is the scatter of the points of each position about its plane (the 95 % nearest
    to it), ``residual_rms_px`` the same in columns and ``limit_px`` what it may be; ``step_error_mm`` is how
    far each position is from where the stage says, with its deviation. ``covariance`` (24, 24) is that of the
    refined lenses and pose; ``column_std_px`` is what it means for zero-order columns and ``depth_std_mm``
    for depths, rms over the image and the range of depth. ``pull`` is how far lenses and pose had to move, in
    their deviations before, rms: about one or less if all is well. ``bow_mm`` is by how much the target seems
    to bulge towards the camera, over 300 mm, with its deviation; the planes are fitted as if it did not.
    """

    problem: StageProblem
    numbers: Floats
    posterior: Floats
    rig: Rig
    planes: tuple[Plane, ...]
    plane_rms_mm: Floats
    residual_rms_px: Floats
    limit_px: Floats
    step_error_mm: Floats
    step_std_mm: Floats
    covariance: Floats
    column_std_px: float
    depth_std_mm: float
    pull: float
    bow_mm: float
    bow_std_mm: float

    def variants(self) -> Iterator[tuple[Rig, tuple[Plane, ...]]]:
        """Rigs and planes that are one deviation off, in each independent direction of what is uncertain."""
        values, directions = np.linalg.eigh(self.posterior)
        for value, direction in zip(values, directions.T, strict=True):
            if value > 0:
                yield _found(self.rig, self.problem, self.numbers + np.sqrt(value) * direction)


def _found(rig: Rig, problem: StageProblem, numbers: Floats) -> tuple[Rig, tuple[Plane, ...]]:
    """The rig and the planes of fitted numbers."""
    shared = problem.shared(numbers)
    camera, projector = rig.camera, rig.projector
    found = rig.model_copy(
        update={
            "camera": lens_of(shared[CAMERA], (camera.width_px, camera.height_px)),
            "projector": lens_of(shared[PROJECTOR], (projector.width_px, projector.height_px)),
            "pose": pose_of(shared[STEREO]),
        }
    )
    return found, tuple(plane_of(numbers[SLOPES], float(d)) for d in problem.distances_mm(numbers))


def refine_planes(
    rig: Rig,
    positions_mm: Sequence[float],
    samples: Sequence[ColumnSamples],
    covariance: Floats | None,
    stage_std_mm: float,
) -> PlaneRefinement:
    """Refine lenses and pose of ``rig``, whose covariance (24, 24) is the prior; None keeps them.

    ``positions_mm`` are what the stage reported, ``samples`` the tile means of each position. Raises
    `CalibrationError` that names the position that shows no plane, or whose step is not what was asked.
    """
    require_tiles(positions_mm, samples)
    slopes, start, rise = _start(rig, positions_mm, samples, stage_std_mm)
    problem = StageProblem(rig, positions_mm, samples, covariance, stage_std_mm)
    free = np.arange(SHARED if covariance is None else 0, len(start))
    numbers, posterior = _gauss_newton(problem, start, free)
    limits = np.array([column_limit_px(part) for part in samples])
    found = _summary(rig, problem, numbers, posterior, limits)
    require_one_angle(positions_mm, slopes, found.residual_rms_px)
    require_plane(positions_mm, found.residual_rms_px)
    require_agreement(found.pull, found.bow_mm, found.bow_std_mm, rise)
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
        weight, _ = huber_weights(residual, sigma, HUBER_SIGMAS)
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


def _bow(problem: StageProblem, numbers: Floats, posterior: Floats) -> tuple[float, float]:
    """The bulge that all positions share and its deviation, mm, while all that was fitted may move with it.

    At the optimum of the other numbers the gradient by them is zero, so that one step of Newton's method with
    the bulge as a further number needs its own row of the normal equations only.
    """
    residual = problem.residual_px(numbers)
    weight, _ = huber_weights(residual, np.hypot(problem.std_px, FLOOR_PX), HUBER_SIGMAS)
    free = np.flatnonzero(np.diag(posterior) > 0)
    bulge, jacobian = problem.bulge(numbers), problem.jacobian(numbers, free)
    shared = jacobian.T @ (weight * bulge)
    information = bulge @ (weight * bulge) - shared @ posterior[np.ix_(free, free)] @ shared
    return float(bulge @ (weight * residual) / information), float(information**-0.5)


def _start(
    rig: Rig, positions_mm: Sequence[float], samples: Sequence[ColumnSamples], stage_std_mm: float
) -> tuple[Floats, Floats, float]:
    """Slopes (positions, 2) of each plane for itself, the start of a joint fit, and how long steps are."""
    slopes, distances, _ = _alone(rig, positions_mm, samples, stage_std_mm)
    rise = require_steps(positions_mm, distances, stage_std_mm)
    start = np.zeros(STEPS + len(samples))
    start[SLOPES] = slopes.mean(0)
    steps = np.asarray(positions_mm) - positions_mm[0]
    start[DISTANCE] = np.median(distances - steps)
    return slopes, start, rise


def lone_plane(rig: Rig, position_mm: float, samples: ColumnSamples) -> tuple[float, float]:
    """Distance (mm) of one plane under the geometry given, and scatter of its columns (px).

    Raises `CalibrationError` when there is no plane.
    """
    require_enough(position_mm, samples)
    _, distances, scatter = _alone(rig, [position_mm], [samples], 1.0)
    return float(distances[0]), float(scatter[0])


def _alone(
    rig: Rig, positions_mm: Sequence[float], samples: Sequence[ColumnSamples], stage_std_mm: float
) -> tuple[Floats, Floats, Floats]:
    """Slopes (positions, 2), distances and scatter of columns (positions,) of the planes, each for itself."""
    slopes, distances, scatter = [], [], []
    for part in samples:
        alone = StageProblem(rig, [0.0], [part], None, stage_std_mm)
        numbers = np.zeros(STEPS + 1)
        numbers[DISTANCE] = np.mean(rig.depth_range_mm)
        # First the distance alone: from far off, slopes would run away.
        for free in ([DISTANCE], [SHARED, SHARED + 1, DISTANCE]):
            numbers, _ = _gauss_newton(alone, numbers, np.array(free), prior=False)
        slopes.append(numbers[SLOPES])
        distances.append(float(numbers[DISTANCE]))
        scatter.append(_rms(alone.residual_px(numbers)))
    require_plane(positions_mm, np.array(scatter))
    return np.array(slopes), np.array(distances), np.array(scatter)


def _summary(
    rig: Rig, problem: StageProblem, numbers: Floats, posterior: Floats, limit_px: Floats
) -> PlaneRefinement:
    shared = problem.shared(numbers)
    covariance = problem.root @ posterior[:SHARED, :SHARED] @ problem.root.T
    refined, planes = _found(rig, problem, numbers)
    residual = problem.residual_px(numbers)
    slope = _per_mm(problem, numbers)
    each = [problem.position_of == k for k in range(len(problem.steps_mm))]
    bow_mm, bow_std_mm = _bow(problem, numbers, posterior)
    column_std, depth_std = systematic_std(refined, shared, problem.root, posterior[:SHARED, :SHARED])
    return PlaneRefinement(
        problem=problem,
        numbers=numbers,
        posterior=posterior,
        rig=refined,
        planes=planes,
        plane_rms_mm=np.array([_rms(residual[part] / slope[part]) for part in each]),
        residual_rms_px=np.array([_rms(residual[part]) for part in each]),
        limit_px=limit_px,
        step_error_mm=numbers[STEPS:] - numbers[STEPS:].mean(),
        step_std_mm=np.sqrt(np.diag(posterior)[STEPS:].clip(0)),
        covariance=covariance,
        column_std_px=column_std,
        depth_std_mm=depth_std,
        pull=float(np.sqrt(np.mean(numbers[:SHARED] ** 2))),
        bow_mm=bow_mm,
        bow_std_mm=bow_std_mm,
    )


def _per_mm(problem: StageProblem, numbers: Floats) -> Floats:
    """By how many columns a millimetre of depth moves the points (n,)."""
    shared, points = problem.shared(numbers), problem.points_mm(numbers)
    ahead, behind = (columns_at(shared, points * (1 + half / points[2])) for half in (0.5, -0.5))
    return ahead - behind


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
    # Tiles at the rim of the light are few and far off; the middle 95 % show what the plane is like.
    limit = np.percentile(np.abs(values), 95)
    return float(np.sqrt(np.mean(values[np.abs(values) <= limit] ** 2)))
