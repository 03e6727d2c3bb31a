"""Triangulated corners are where both pictures are matched best."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from dsl_core.calibration.geometry.bundle import (
    CAMERA,
    PROJECTOR,
    SHARED,
    STEREO,
    Prior,
    Problem,
    _farthest,
    _noise,
    _sides,
    _solve,
    _summary,
    _weights,
    adjust,
    flatness,
    move,
    project,
    triangulate,
    vector_of,
)
from dsl_core.calibration.geometry.projector_corners import PoseObservation
from dsl_core.errors import CalibrationError
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


@pytest.mark.parametrize("noise_mm", [0.0, 0.3])
def test_a_bow_is_measured_whatever_corners_are_off_by(noise_mm: float) -> None:
    board = corner_positions_mm(case.BOARD)
    middle, half = board.mean(0), np.ptp(board[:, 0]) / 2
    bow = np.square((board - middle)[:, 0] / half) * [[0], [0], [0.8]]
    noise = np.random.default_rng(3).normal(0, noise_mm, len(board)) if noise_mm else np.zeros(len(board))
    seen = board + [0, 0, 1000.0] + bow.T + noise[:, None] * [0, 0, 1]
    found = flatness(seen, np.arange(63), case.BOARD)
    assert found.shape_rms_mm == pytest.approx(bow[2].std(), rel=0.25 if noise_mm else 0.01)
    flat = flatness(board + [0, 0, 1000.0] + noise[:, None] * [0, 0, 1], np.arange(63), case.BOARD)
    assert flat.shape_rms_mm < 0.4 * noise_mm + 1e-6
    few = flatness(seen[:15], np.arange(15), case.BOARD)
    assert few.shape_rms_mm == few.plane_rms_mm


def test_a_bent_board_is_measured() -> None:
    board = corner_positions_mm(case.BOARD)
    bent = board + np.array([0, 0, 1000.0]) + np.where(np.arange(63) % 2, 0.5, -0.5)[:, None] * [0, 0, 1]
    found = flatness(bent, np.arange(63), case.BOARD)
    assert found.plane_rms_mm == pytest.approx(0.5, rel=0.01)
    assert found.square_mm == pytest.approx(np.hypot(30, 1), rel=1e-6)
    assert found.shape_rms_mm == pytest.approx(0, abs=0.05), "no shape of a board, but corners that are off"
    flat = flatness(board[:40], np.arange(40), case.BOARD)
    assert flat.square_mm == pytest.approx(30)
    assert flat.square_std_mm == pytest.approx(0, abs=1e-9)


class Linear:
    """Corners whose errors in both pictures are linear in the parameters, in the place of a bundle."""

    priors: tuple[Prior, ...] = ()

    def __init__(self, count: int = 40, seed: int = 1) -> None:
        rng = np.random.default_rng(seed)
        self.slopes = rng.standard_normal((2, count, 2, 3))
        self.seen = rng.standard_normal((2, count, 2))
        self.pose_of = np.zeros(count, int)

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
    assert sigmas[[2, 3, 4]] == pytest.approx(np.array([0.1, 0.7, 0.9]) / 0.14826022185)
    weights = _weights(problem, np.zeros(3), np.ones(100, bool))  # type: ignore[arg-type]
    assert weights[2] == 1.0
    assert (weights[[3, 4]] < 1).all()


def test_noise_is_robust_by_axis_and_never_nothing() -> None:
    residual = np.stack([np.linspace(-1, 1, 101), np.zeros(101)], 1)
    assert _noise(residual) == pytest.approx([1.4826022185 * 0.5, 1e-4])


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


@pytest.mark.parametrize(("corners", "enough"), [(2, False), (3, True)])
def test_corners_have_to_say_more_than_there_is_to_find(
    corners: int, enough: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Four numbers a corner, nine unknowns; of six corners some are outliers."""
    problem = Linear(6)
    problem.slopes = np.random.default_rng(2).standard_normal((2, 6, 2, 9))
    problem.seen = problem.slopes @ np.linspace(-1, 1, 9)
    module = "dsl_core.calibration.geometry.bundle."
    monkeypatch.setattr(module + "Problem", lambda *_: problem)
    monkeypatch.setattr(module + "_weights", lambda *_: (np.arange(6) < corners).astype(float))
    if enough:
        assert adjust([], np.zeros(9)).used.sum() == 3
    else:
        with pytest.raises(CalibrationError, match="most corners are outliers"):
            adjust([], np.zeros(9))


def test_corners_far_off_do_not_count_and_those_off_by_little_weigh_less(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    rng, problem = np.random.default_rng(4), Linear(200)
    truth = np.array([0.3, -0.2, 0.1])
    problem.seen = problem.slopes @ truth + 0.01 * rng.standard_normal((2, 200, 2))
    problem.seen[0, :20] += 5.0
    monkeypatch.setattr("dsl_core.calibration.geometry.bundle.Problem", lambda *_: problem)
    found = adjust([], np.zeros(3))
    assert not found.used[:20].any()
    assert found.used[20:].mean() > 0.97
    assert found.parameters == pytest.approx(truth, abs=0.005)
    assert found.camera_residual_px == pytest.approx(problem.slopes[0] @ found.parameters - problem.seen[0])


def test_weights_are_one_up_to_four_deviations_then_less_and_nothing_where_errors_do_harm() -> None:
    problem = Linear(100)
    for spread, far, weight in (
        # Within four deviations; beyond them and harmless; beyond them and not.
        (0.01, 0.055, 1.0), (0.01, 0.079, 4 / (0.079 / 0.014826)), (0.01, 0.081, 0.0), (0.05, 0.29, 1.0),
    ):  # fmt: skip
        problem.seen[:] = np.where(np.arange(100) % 2, spread, -spread)[:, None]
        problem.seen[1, 7, 0] = far
        found = _weights(problem, np.zeros(3), np.ones(100, bool))  # type: ignore[arg-type]
        assert found[7] == pytest.approx(weight, rel=1e-3)
        assert np.delete(found, 7) == pytest.approx(1.0)


def test_a_fit_that_ends_nowhere_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = list[dict[str, Any]]()

    def lost(residuals: Any, start: Any, **more: Any) -> Any:
        asked.append(more)
        return SimpleNamespace(x=np.full(3, np.nan))

    monkeypatch.setattr("scipy.optimize.least_squares", lost)
    one = np.ones(2)
    with pytest.raises(CalibrationError, match="did not converge"):
        _solve(Linear(), np.zeros(3), (one, one), np.ones(40))  # type: ignore[arg-type]
    # Levenberg and Marquardt, whatever the units of the parameters, within two hundred looks.
    jacobian = asked[0].pop("jac")(np.zeros(3))
    assert jacobian.shape == (160, 3)
    assert asked == [{"method": "lm", "x_scale": "jac", "max_nfev": 200}]


def test_what_is_known_before_counts_like_one_more_measurement_and_scatters_as_it_says() -> None:
    problem = Linear(60)
    # Nothing is measured of the last number but what is stated of it.
    problem.slopes[..., 2] = 0
    problem.seen = problem.slopes @ np.array([0.3, -0.2, 0.0])
    problem.priors = (Prior(2, 5.0, 0.25),)
    one = np.ones(2)
    found = _solve(problem, np.zeros(3), (one, one), np.ones(60))  # type: ignore[arg-type]
    np.testing.assert_allclose(found, [0.3, -0.2, 5.0], atol=1e-9)
    problem.seen += 0.01 * np.random.default_rng(5).standard_normal((2, 60, 2))
    summary = _summary(problem, found, np.ones(60), (one, one))  # type: ignore[arg-type]
    assert np.sqrt(summary.covariance[2, 2]) == pytest.approx(0.25)
    problem.priors = ()
    assert _summary(problem, found, np.ones(60), (one, one)).covariance[2, 2] == 0  # type: ignore[arg-type]


def test_rows_that_are_not_known_have_no_residual_and_do_not_place_points() -> None:
    seen, shared = case.poses_seen(noise_px=0.0)[1], _truth()
    columns = replace(seen, projector_px=np.where([True, False], seen.projector_px, np.nan))
    problem = Problem([columns])
    parameters = np.append(shared, [0.1, 0.2, 0.0, 0.0, 0.0, 900.0])
    _, residual, _, slope = problem.evaluate(parameters)
    _, full, _, full_slope = Problem([seen]).evaluate(parameters)
    assert not residual[:, 1].any()
    assert not slope[:, 1].any()
    np.testing.assert_array_equal(residual[:, 0], full[:, 0])
    np.testing.assert_array_equal(slope[:, 0], full_slope[:, 0])
    start = np.tile([0.0, 0.0, 900.0], (len(seen.ids), 1))
    points, known = (triangulate(shared, each, start) for each in (columns, seen))
    np.testing.assert_allclose(points, known, atol=1e-6)
