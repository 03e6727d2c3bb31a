"""Planes on a stage improve a geometry that a board left uncertain, and say when something is wrong."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import torch
from numpy.typing import NDArray

from dsl_core.calibration.common.tiles import ColumnSamples
from dsl_core.calibration.geometry.bundle import CAMERA, PROJECTOR
from dsl_core.calibration.geometry.plane_refinement import (
    PlaneRefinement,
    _gauss_newton,
    _per_mm,
    _rms,
    lone_plane,
    refine_planes,
    systematic_std,
)
from dsl_core.calibration.geometry.stage_planes import (
    columns_at,
    plane_of,
    rays_through,
    shared_parameters,
    with_unsure_zero,
)
from dsl_core.errors import CalibrationError
from dsl_core.model.rig import Rig
from dsl_core.optics.correspondence import zero_order
from dsl_core.optics.pinhole import pixel_rays
from dsl_core.simulation.published_rig import published_rig
from dsl_core.simulation.random_rig import random_rig
from tests.cases.board_calibrated import board_calibrated

SIZE = (222, 145)
POSITIONS_MM = (600.0, 750.0, 900.0)
NOISE_PX, STAGE_STD_MM = 0.004, 0.02


def small_rig() -> Rig:
    rig = published_rig()
    return rig.model_copy(update={"camera": rig.camera.resized(*SIZE)})


def seen(
    truth: Rig,
    distance_mm: float,
    rng: np.random.Generator,
    bow_mm: float = 0.0,
    tilt: float = 0.02,
    rim_mm: float = 0.0,
) -> ColumnSamples:
    """Columns of a plane, bent by so much over the view, or domed over 300 mm, as tile means show them."""
    x, y = np.meshgrid(np.linspace(2, SIZE[0] - 3, 30), np.linspace(2, SIZE[1] - 3, 20))
    pixels = np.stack([x.ravel(), y.ravel()], 1)
    shared = shared_parameters(truth)
    rays = rays_through(shared[CAMERA], pixels)
    depth = 1 / np.tensordot(plane_of(np.array([tilt, 0.0]), distance_mm).inverse, rays, 1)
    bulge = bow_mm * ((x.ravel() - SIZE[0] / 2) / (SIZE[0] / 2)) ** 2
    bulge = bulge + rim_mm * ((rays * depth)[:2] ** 2).sum(0) / 150.0**2
    columns = columns_at(shared, rays * (depth + bulge))
    inside = (columns > 0) & (columns < 639)
    noisy = columns[inside] + NOISE_PX * rng.standard_normal(int(inside.sum()))
    return ColumnSamples(pixels[inside], noisy, np.full(len(noisy), NOISE_PX))


def distances_mm(rng: np.random.Generator) -> NDArray[np.float64]:
    """Of planes that a stage carries along the camera's axis, tilted by 0.02."""
    steps = np.array(POSITIONS_MM) + STAGE_STD_MM * rng.standard_normal(3)
    return np.asarray(steps / np.sqrt(1 + 0.02**2))


def column_error_px(truth: Rig, rig: Rig) -> float:
    rng = np.random.default_rng(1)
    pixels = torch.as_tensor(rng.integers(0, SIZE[0] * SIZE[1], 4000))
    depth = torch.as_tensor(rng.uniform(600, 900, 4000))
    column, row = zero_order(truth, pixels, depth)
    inside = (column > 0) & (column < 639) & (row > 0) & (row < 359)
    return float((zero_order(rig, pixels, depth)[0] - column)[inside].square().mean().sqrt())


@cache
def board_said(seed: int) -> tuple[Rig, NDArray[np.float64]]:
    """What a board says of a drawn rig, and the covariance of it."""
    board = board_calibrated(random_rig(seed, small_rig()), small_rig(), seed)
    assert board.geometry_covariance is not None
    return board, np.array(board.geometry_covariance).reshape(24, 24)


def refined(seed: int) -> tuple[Rig, Rig, PlaneRefinement]:
    """Truth, what the board said, and what the planes made of it."""
    truth, rng = random_rig(seed, small_rig()), np.random.default_rng(seed)
    board, covariance = board_said(seed)
    samples = [seen(truth, distance, rng) for distance in distances_mm(rng)]
    return truth, board, refine_planes(board, POSITIONS_MM, samples, covariance, STAGE_STD_MM)


@pytest.fixture(scope="module")
def several() -> list[tuple[Rig, Rig, PlaneRefinement]]:
    return [refined(seed) for seed in range(6, 9)]


def test_columns_come_nearer_to_the_truth(several: list[tuple[Rig, Rig, PlaneRefinement]]) -> None:
    before = [column_error_px(truth, board) for truth, board, _ in several]
    after = [column_error_px(truth, found.rig) for truth, _, found in several]
    assert np.sqrt(np.mean(np.square(after))) < 0.7 * np.sqrt(np.mean(np.square(before)))
    assert max(after) < 0.04


def test_stated_deviations_cover_the_errors(several: list[tuple[Rig, Rig, PlaneRefinement]]) -> None:
    pulls = [column_error_px(truth, found.rig) / found.column_std_px for truth, _, found in several]
    assert 0.4 < np.sqrt(np.mean(np.square(pulls))) < 1.7


@pytest.mark.slow
def test_lines_that_are_counted_from_elsewhere_take_the_geometry_with_them() -> None:
    off_px, errors = 0.06, []
    for seed in range(6, 9):
        truth, rng = random_rig(seed, small_rig()), np.random.default_rng(seed)
        board, known = board_said(seed)
        samples = [seen(truth, distance, rng) for distance in distances_mm(rng)]
        samples = [replace(part, column_px=part.column_px + off_px) for part in samples]
        middle = {"cx_px": truth.projector.cx_px + off_px}
        as_lines = truth.model_copy(update={"projector": truth.projector.model_copy(update=middle)})
        found = [
            refine_planes(board, POSITIONS_MM, samples, covariance, STAGE_STD_MM)
            for covariance in (known, with_unsure_zero(known, 0.05))
        ]
        errors.append([column_error_px(as_lines, each.rig) for each in found])
        assert found[1].column_std_px < 1.05 * found[0].column_std_px, "the stage's steps tell"
    held, followed = np.sqrt(np.mean(np.square(errors), axis=0))
    assert followed < 0.6 * held


def test_rigs_one_deviation_off_vary_by_the_covariance(
    several: list[tuple[Rig, Rig, PlaneRefinement]],
) -> None:
    for _, _, found in several:
        own = shared_parameters(found.rig).ravel()
        off = np.stack([shared_parameters(rig).ravel() - own for rig, _ in found.variants()])
        assert np.diag(off.T @ off) == pytest.approx(np.diag(found.covariance), rel=0.02, abs=1e-12)


def test_a_bulge_at_all_positions_is_measured(several: list[tuple[Rig, Rig, PlaneRefinement]]) -> None:
    for _, _, flat in several:
        assert abs(flat.bow_mm) < 3 * flat.bow_std_mm < 0.3
    truth, rng = random_rig(6, small_rig()), np.random.default_rng(0)
    board, covariance = board_said(6)
    samples = [seen(truth, distance, rng, rim_mm=0.4) for distance in distances_mm(rng)]
    found = refine_planes(board, POSITIONS_MM, samples, covariance, STAGE_STD_MM)
    assert found.bow_mm == pytest.approx(0.4, abs=3 * found.bow_std_mm)
    # The planes themselves look as flat as ever: lenses bend them straight.
    assert found.plane_rms_mm.max() < 0.1


def test_planes_are_as_flat_as_the_noise(several: list[tuple[Rig, Rig, PlaneRefinement]]) -> None:
    for truth, _, found in several:
        assert found.residual_rms_px.max() < 1.1 * NOISE_PX
        assert found.pull < 1.8
        assert np.abs(found.step_error_mm).max() < 4 * STAGE_STD_MM
        middle = pixel_rays(truth.camera)[:, SIZE[1] // 2, SIZE[0] // 2]
        depths = [1 / (plane.inverse @ middle) for plane in found.planes]
        np.testing.assert_allclose(np.diff(depths), 150, atol=0.2)


def test_without_covariance_the_geometry_stays() -> None:
    truth, rng = small_rig(), np.random.default_rng(0)
    samples = [seen(truth, distance, rng) for distance in distances_mm(rng)]
    found = refine_planes(truth, POSITIONS_MM, samples, None, STAGE_STD_MM)
    np.testing.assert_allclose(shared_parameters(found.rig), shared_parameters(truth), atol=1e-9)
    assert [plane.tilt_deg for plane in found.planes] == pytest.approx([np.degrees(0.02)] * 3, rel=0.01)


def _samples(truth: Rig) -> list[ColumnSamples]:
    rng = np.random.default_rng(2)
    return [seen(truth, distance, rng) for distance in distances_mm(rng)]


def test_a_bowed_plane_misses_its_limit_and_no_plane_at_all_is_refused() -> None:
    truth, samples = small_rig(), _samples(small_rig())
    samples[1] = seen(truth, 750.0, np.random.default_rng(0), bow_mm=3.0)
    found = refine_planes(truth, POSITIONS_MM, samples, None, STAGE_STD_MM)
    missed = found.residual_rms_px > found.limit_px
    assert missed.tolist() == [False, True, False]
    samples[1] = seen(truth, 750.0, np.random.default_rng(0), bow_mm=40.0)
    with pytest.raises(CalibrationError, match=r"750 mm are .* px RMS off those of a plane"):
        refine_planes(truth, POSITIONS_MM, samples, None, STAGE_STD_MM)


def test_a_target_that_turned_between_positions_is_named() -> None:
    truth, samples = small_rig(), _samples(small_rig())
    samples[1] = seen(truth, 750.0, np.random.default_rng(0), tilt=0.02 + np.tan(np.radians(8.0)))
    with pytest.raises(CalibrationError, match=r"position 750 mm stands at an angle of [678]\.\d degrees"):
        refine_planes(truth, POSITIONS_MM, samples, None, STAGE_STD_MM)


@pytest.mark.slow
def test_a_target_that_bulges_everywhere_contradicts_the_board() -> None:
    truth, rng = random_rig(6, small_rig()), np.random.default_rng(0)
    board, covariance = board_said(6)
    samples = [seen(truth, distance, rng, bow_mm=1.5) for distance in distances_mm(rng)]
    with pytest.raises(
        CalibrationError,
        match=r"planes contradict the geometry .* bulge towards the camera by -?\d\.\d\d ± 0\.0\d mm",
    ):
        refine_planes(board, POSITIONS_MM, samples, covariance, STAGE_STD_MM)


def test_one_plane_is_looked_at_while_it_still_stands_there() -> None:
    truth, rng = small_rig(), np.random.default_rng(0)
    distance, scatter = lone_plane(truth, 750.0, seen(truth, 740.0, rng))
    assert distance == pytest.approx(740.0, abs=0.05)
    assert scatter == pytest.approx(NOISE_PX, rel=0.2)
    _, bowed = lone_plane(truth, 750.0, seen(truth, 740.0, rng, bow_mm=3.0))
    assert bowed > 10 * scatter
    with pytest.raises(CalibrationError, match=r"750 mm are .* px RMS off those of a plane"):
        lone_plane(truth, 750.0, seen(truth, 740.0, rng, bow_mm=40.0))


def test_a_step_that_was_not_made_is_named() -> None:
    truth, samples = small_rig(), _samples(small_rig())
    samples[2] = seen(truth, 896.0, np.random.default_rng(0))
    with pytest.raises(CalibrationError, match=r"position \d+ mm is .* mm from"):
        refine_planes(truth, POSITIONS_MM, samples, None, STAGE_STD_MM)


def test_a_stage_of_another_scale_is_noticed() -> None:
    samples = _samples(small_rig())
    with pytest.raises(CalibrationError, match=r"1\.0[45]\d times as far apart"):
        refine_planes(small_rig(), tuple(p / 1.05 for p in POSITIONS_MM), samples, None, STAGE_STD_MM)


@pytest.mark.slow
def test_steps_a_little_too_long_are_told_by_their_ratio() -> None:
    truth, rng = random_rig(6, small_rig()), np.random.default_rng(6)
    board, covariance = board_said(6)
    samples = [seen(truth, distance, rng) for distance in distances_mm(rng)]
    said = tuple(700 + (p - 700) / 1.01 for p in POSITIONS_MM)
    with pytest.raises(CalibrationError, match=r"steps are 1\.0(09|10|11) times as long"):
        refine_planes(board, said, samples, covariance, STAGE_STD_MM)


def test_captures_of_another_rig_are_named() -> None:
    samples = _samples(small_rig())
    samples[0] = seen(random_rig(5, small_rig()), 600.0, np.random.default_rng(0))
    with pytest.raises(CalibrationError, match="600 mm"):
        refine_planes(small_rig(), POSITIONS_MM, samples, None, STAGE_STD_MM)


def test_too_little_light_is_named() -> None:
    samples = _samples(small_rig())
    few = samples[1]
    samples[1] = replace(few, camera_px=few.camera_px[:5], column_px=few.column_px[:5], std_px=few.std_px[:5])
    with pytest.raises(CalibrationError, match="750 mm only 5 tiles"):
        refine_planes(small_rig(), POSITIONS_MM, samples, None, STAGE_STD_MM)


class LinearStage:
    """Points whose columns are linear in the numbers, in the place of planes on a stage."""

    def __init__(self, design: NDArray[np.float64], seen: NDArray[np.float64], std_px: float) -> None:
        self.design, self.seen = design, seen
        self.std_px = np.full(len(seen), std_px)
        self.prior_weight = np.array([0.0, 3.0, 0.0])

    def residual_px(self, numbers: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(self.seen - self.design @ numbers)

    def jacobian(self, _: NDArray[np.float64], free: NDArray[np.int64]) -> NDArray[np.float64]:
        return np.asarray(self.design[:, free])


def test_numbers_are_those_of_least_squares_with_their_prior() -> None:
    rng = np.random.default_rng(5)
    design = rng.standard_normal((200, 3))
    # Deviations of 0.01 px and the floor of 0.002 together; no residual beyond two and a half of them.
    noise = np.hypot(0.01, 0.002) * np.linspace(-1.7, 1.7, 200)[rng.permutation(200)]
    seen = design @ [0.3, -0.2, 0.1] + noise
    weight = 1 / (0.01**2 + 0.002**2)
    free = np.array([0, 1])
    for prior, pull in ((True, np.diag([0.0, 9.0])), (False, np.zeros((2, 2)))):
        stage = LinearStage(design, seen, 0.01)
        start = np.array([0.0, 0.0, 0.1])
        numbers, covariance = _gauss_newton(stage, start, free, prior)  # type: ignore[arg-type]
        scale = max(1.0, 1.4826022185 * float(np.median(np.abs(stage.residual_px(numbers)))) * weight**0.5)
        information = design[:, free].T @ design[:, free] * weight / scale**2 + pull
        right = design[:, free].T @ (seen - 0.1 * design[:, 2]) * weight / scale**2
        assert numbers[free] == pytest.approx(np.linalg.solve(information, right), rel=1e-4)
        assert numbers[2] == 0.1
        assert covariance[np.ix_(free, free)] == pytest.approx(np.linalg.inv(information), rel=1e-3)
        assert not covariance[2].any()


def test_scatter_is_that_of_the_middle_ninety_five_percent() -> None:
    assert _rms(np.r_[np.full(96, -2.0), np.full(4, 100.0)]) == pytest.approx(2.0)
    assert _rms(np.r_[np.full(94, 2.0), np.full(6, 100.0)]) > 20


def stand_in(shared: NDArray[np.float64], points: NDArray[np.float64]) -> Any:
    return SimpleNamespace(shared=lambda _: shared, points_mm=lambda _: points)


def test_a_millimetre_of_depth_moves_points_half_of_it_to_either_side() -> None:
    shared, rig = shared_parameters(small_rig()), small_rig()
    pixels = np.array([[20.0, 30.0], [110.0, 70.0], [200.0, 120.0]])
    points = rays_through(shared[CAMERA], pixels) * 700.0
    found = _per_mm(stand_in(shared, points), np.zeros(0))
    near, far = (points * (z / 700.0) for z in (699.5, 700.5))
    assert found == pytest.approx(columns_at(shared, far) - columns_at(shared, near), rel=1e-9)
    assert (np.abs(found) > 0.01).all()
    assert rig.camera.width_px == SIZE[0]


def test_what_columns_are_off_by_is_off_in_depth_by_their_slope_rms_over_what_is_in_view() -> None:
    rig = small_rig()
    shared = shared_parameters(rig)
    # The second direction moves the projector's principal column by 3 px for one of its deviations of 0.1.
    shared[PROJECTOR.start + 2] += 200.0
    root, posterior = np.zeros((24, 24)), np.eye(24) * 25.0
    root[PROJECTOR.start + 2, 1], posterior[1, 1] = 3.0, 0.01
    column_std, depth_std = systematic_std(rig, shared, root, posterior)
    assert column_std == pytest.approx(0.3, rel=1e-6)
    x, y = np.meshgrid(np.linspace(0, SIZE[0] - 1, 12), np.linspace(0, SIZE[1] - 1, 8))
    rays, squares = rays_through(shared[CAMERA], np.stack([x.ravel(), y.ravel()], 1)), list[float]()
    for z in np.linspace(*rig.depth_range_mm, 5):
        slope = columns_at(shared, rays * (z + 0.5)) - columns_at(shared, rays * (z - 0.5))
        seen = columns_at(shared, rays * z)
        squares += ((0.3 / slope) ** 2)[(seen > -0.5) & (seen < rig.projector.width_px - 0.5)].tolist()
    assert 0 < len(squares) < 5 * 96, "some of it is out of the projector's view"
    assert depth_std == pytest.approx(np.mean(squares) ** 0.5, rel=1e-6)


def test_residuals_beyond_two_and_a_half_deviations_pull_as_those_at_it() -> None:
    rng = np.random.default_rng(8)
    design = np.ones((400, 3)) * [1.0, 0.0, 0.0]
    seen = np.hypot(0.01, 0.002) * rng.standard_normal(400)
    seen[:40] += 0.2
    stage = LinearStage(design, seen, 0.01)
    numbers, _ = _gauss_newton(stage, np.zeros(3), np.array([0]), False)  # type: ignore[arg-type]
    off = stage.residual_px(numbers) / np.hypot(0.01, 0.002)
    scale = max(1.0, 1.4826022185 * float(np.median(np.abs(off))))
    pulls = [abs(float(np.clip(off / scale, -limit, limit).mean())) for limit in (2.5, 3.0, 2.0)]
    assert pulls[0] < 3e-3
    assert min(pulls[1:]) > 0.02
