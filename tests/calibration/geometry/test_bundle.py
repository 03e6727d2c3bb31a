"""Triangulated corners are where both pictures are matched best."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.calibration.geometry.bundle import (
    CAMERA,
    PROJECTOR,
    SHARED,
    STEREO,
    _farthest,
    _noise,
    _sides,
    _solve,
    _summary,
    _weights,
    flatness,
    move,
    project,
    triangulate,
    vector_of,
)
from dsl_core.calibration.geometry.projector_corners import PoseObservation
from dsl_core.model.board import corner_positions_mm
from tests.cases import board_poses as case

Floats = case.Floats


def _truth() -> Floats:
    shared = np.zeros(SHARED)
    for part, lens in ((CAMERA, case.CAMERA), (PROJECTOR, case.PROJECTOR)):
        shared[part] = [lens.fx_px, lens.fy_px, lens.cx_px, lens.cy_px, *lens.distortion]
    shared[STEREO] = [*vector_of(case.POSE.matrix), *case.POSE.vector_mm]
    return shared


def _squares(shared: Floats, seen: PoseObservation, points: Floats) -> Floats:
    camera, _, _ = project(shared[CAMERA], points)
    there, _ = move(np.broadcast_to(shared[STEREO], (len(points), 6)), points)
    projector, _, _ = project(shared[PROJECTOR], there)
    errors = np.concatenate([camera - seen.camera_px, projector - seen.projector_px], 1)
    return np.asarray((errors**2).sum(1))


def test_no_point_near_by_is_better() -> None:
    seen, shared = case.poses_seen(noise_px=2.0)[1], _truth()
    points = triangulate(shared, seen, np.tile([0.0, 0.0, 900.0], (len(seen.ids), 1)))
    best = _squares(shared, seen, points)
    for axis in np.eye(3):
        for step_mm in (-0.02, 0.02):
            assert (_squares(shared, seen, points + step_mm * axis) > best).all()


def test_a_bent_board_is_measured() -> None:
    board = corner_positions_mm(case.BOARD)
    bent = board + np.array([0, 0, 1000.0]) + np.where(np.arange(63) % 2, 0.5, -0.5)[:, None] * [0, 0, 1]
    found = flatness(bent, np.arange(63), case.BOARD)
    assert found.plane_rms_mm == pytest.approx(0.5, rel=0.01)
    assert found.square_mm == pytest.approx(np.hypot(30, 1), rel=1e-6)
    flat = flatness(board[:40], np.arange(40), case.BOARD)
    assert flat.square_mm == pytest.approx(30)
    assert flat.square_std_mm == pytest.approx(0, abs=1e-9)


class Linear:
    """Corners whose errors in both pictures are linear in the parameters, in the place of a bundle."""

    def __init__(self, count: int = 40, seed: int = 1) -> None:
        rng = np.random.default_rng(seed)
        self.slopes = rng.standard_normal((2, count, 2, 3))
        self.seen = rng.standard_normal((2, count, 2))

    def evaluate(self, parameters: Floats) -> tuple[Floats, Floats, Floats, Floats]:
        camera, projector = self.slopes @ parameters - self.seen
        return camera, projector, self.slopes[0], self.slopes[1]

    def carried(self, camera: Floats) -> Floats:
        return 0 * camera


def test_camera_and_projector_are_weighted_by_their_own_noise_across_and_down() -> None:
    problem, sigmas = Linear(), (np.array([0.5, 1.0]), np.array([2.0, 0.25]))
    weights = np.linspace(0.1, 1.0, 40)
    found = _solve(problem, np.zeros(3), sigmas, weights)  # type: ignore[arg-type]
    normal, right = np.zeros((3, 3)), np.zeros(3)
    for device in range(2):
        for corner in range(40):
            for axis in range(2):
                row = problem.slopes[device, corner, axis]
                weight = weights[corner] / sigmas[device][axis] ** 2
                normal += weight * np.outer(row, row)
                right += weight * row * problem.seen[device, corner, axis]
    assert found == pytest.approx(np.linalg.solve(normal, right), rel=1e-6)


def test_a_corner_is_judged_by_the_farthest_of_its_four_errors() -> None:
    problem = Linear(100)
    problem.seen[:] = np.where(np.arange(100) % 2, 0.1, -0.1)[:, None]
    problem.seen[0, 3, 1], problem.seen[1, 4, 0] = 0.7, -0.9
    sigmas, pixels = _farthest(problem, np.zeros(3), np.ones(100, bool))  # type: ignore[arg-type]
    assert pixels[[2, 3, 4]] == pytest.approx([0.1, 0.7, 0.9])
    assert sigmas[[2, 3, 4]] == pytest.approx(np.array([0.1, 0.7, 0.9]) / 0.14826)
    weights = _weights(problem, np.zeros(3), np.ones(100, bool))  # type: ignore[arg-type]
    assert weights[2] == 1.0
    assert (weights[[3, 4]] < 1).all()


def test_noise_is_robust_by_axis_and_never_nothing() -> None:
    residual = np.stack([np.linspace(-1, 1, 101), np.zeros(101)], 1)
    assert _noise(residual) == pytest.approx([1.4826 * 0.5, 1e-4])


def test_parameters_scatter_by_what_their_covariance_says_with_its_margin() -> None:
    """Errors of a corner go together: the second is the first, which a sum over coordinates would miss."""
    rng, found, stated = np.random.default_rng(3), [], []
    problem, one = Linear(150), np.ones(2)
    problem.slopes[:, :, 1] = problem.slopes[:, :, 0]
    for _ in range(200):
        problem.seen[:] = rng.standard_normal((1, 150, 1))
        numbers = _solve(problem, np.zeros(3), (one, one), np.ones(150))  # type: ignore[arg-type]
        fit = _summary(problem, numbers, np.ones(150), (one, one))  # type: ignore[arg-type]
        found.append(numbers)
        stated.append(np.diag(fit.covariance))
    assert np.sqrt(np.mean(stated, 0)) == pytest.approx(1.2 * np.std(found, 0), rel=0.15)


def test_sides_are_those_of_squares_whose_corners_were_both_seen() -> None:
    board = corner_positions_mm(case.BOARD)
    columns, rows = case.BOARD.corner_grid
    stretched = board * [1.0, 2.0, 1.0]
    sides = _sides(stretched, np.arange(len(board)), case.BOARD)
    assert sorted(np.unique(sides.round(6))) == [30.0, 60.0]
    assert np.count_nonzero(sides < 45) == rows * (columns - 1)
    assert np.count_nonzero(sides > 45) == columns * (rows - 1)
    # Without the first corner two sides are missing.
    assert len(_sides(stretched[1:], np.arange(1, len(board)), case.BOARD)) == len(sides) - 2
