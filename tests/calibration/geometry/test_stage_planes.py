"""Columns of a plane on a stage as a function of all that is uncertain, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from dsl_core.calibration.common.tiles import ColumnSamples
from dsl_core.calibration.geometry.bundle import SHARED
from dsl_core.calibration.geometry.stage_planes import (
    BOW_RADIUS_MM,
    DISTANCE,
    GAIN,
    SLOPES,
    STEPS,
    StageProblem,
    column_limit_px,
    covariance_root,
    plane_of,
    require_agreement,
    require_one_angle,
    require_plane,
    require_steps,
    require_tiles,
    shared_parameters,
)
from dsl_core.errors import CalibrationError
from dsl_core.optics.correspondence import zero_order
from dsl_core.simulation.published_rig import published_rig

RIG = published_rig()
POSITIONS = [600.0, 700.0, 800.0]


def problem(covariance: np.ndarray | None = None) -> StageProblem:
    """Samples on a grid of whole pixels; columns are not yet those of any plane."""
    x, y = (
        axis.ravel().astype(float) for axis in np.meshgrid(np.arange(50, 850, 80), np.arange(40, 560, 60))
    )
    part = ColumnSamples(np.stack([x, y], 1), np.zeros(x.size), np.full(x.size, 0.01))
    return StageProblem(RIG, POSITIONS, [part] * 3, covariance, 0.01)


def numbers() -> np.ndarray:
    found = np.zeros(STEPS + 3)
    found[SLOPES], found[DISTANCE], found[GAIN] = (0.03, -0.02), 605.0, 1e-4
    found[STEPS:] = 0.01, -0.02, 0.0
    return found


def test_columns_are_those_of_the_zero_order_on_the_planes() -> None:
    stage, values = problem(), numbers()
    distances = stage.distances_mm(values)
    normal = np.sqrt(1 + 0.03**2 + 0.02**2)
    assert distances == pytest.approx([605.01, 604.98 + 100 * 1.0001 / normal, 605.0 + 200 * 1.0001 / normal])
    for k, distance in enumerate(distances):
        mine = stage.position_of == k
        x, y = stage.camera_px[mine].astype(int).T
        depth = plane_of(values[SLOPES], distance).depth_mm(RIG)[y, x]
        column, _ = zero_order(RIG, torch.as_tensor(y * RIG.camera.width_px + x), torch.as_tensor(depth))
        assert -stage.residual_px(values)[mine] == pytest.approx(column.numpy(), abs=1e-6)


def test_derivatives_are_those_of_the_columns() -> None:
    covariance = np.diag(np.square(np.full(SHARED, 1e-4)))
    stage, values = problem(covariance), numbers()
    free = np.arange(len(values))
    jacobian = stage.jacobian(values, free)
    move = np.random.default_rng(0).standard_normal(len(values)) * 1e-5
    change = stage.residual_px(values) - stage.residual_px(values + move)
    assert change == pytest.approx(jacobian @ move, abs=1e-7 + 1e-3 * np.abs(change).max())


def test_a_bulge_of_a_millimetre_falls_off_to_the_rim() -> None:
    stage, values = problem(), numbers()
    points = stage.points_mm(values)
    rim = np.hypot(*(points[:2] - points[:2].mean(1, keepdims=True))) / BOW_RADIUS_MM
    farther = 1 + rim**2 / stage.distances_mm(values)[stage.position_of]
    slope = stage.bulge(values) / (farther - 1)
    # Points farther away move alike per millimetre wherever they are in the picture, within the geometry.
    assert np.ptp(np.sign(slope)) == 0
    assert np.abs(stage.bulge(values)).argmin() == rim.argmin()


def test_the_root_of_a_covariance_gives_it_back_whatever_the_scales() -> None:
    rng = np.random.default_rng(0)
    mix = rng.standard_normal((24, 24)) * np.geomspace(1e-6, 1e3, 24)[:, None]
    covariance = mix @ mix.T
    root = covariance_root(covariance)
    scale = np.sqrt(np.diag(covariance))
    assert (root @ root.T) / np.outer(scale, scale) == pytest.approx(
        covariance / np.outer(scale, scale), abs=1e-9
    )


def test_parameters_are_those_of_the_rig() -> None:
    found = shared_parameters(RIG)
    assert found[:4] == pytest.approx(
        [RIG.camera.fx_px, RIG.camera.fy_px, RIG.camera.cx_px, RIG.camera.cy_px]
    )
    assert found[9] == RIG.projector.fx_px
    assert found[21:] == pytest.approx(RIG.pose.translation_mm)


@pytest.mark.parametrize(("distance_mm", "pitch", "noise_px"), [(600, 1.4, 1e-3), (900, 2.8, 0.02)])
def test_the_limit_of_a_plane_is_in_columns_and_follows_the_capture(
    distance_mm: float, pitch: float, noise_px: float
) -> None:
    x, y = (axis.ravel().astype(float) for axis in np.meshgrid(np.arange(30), np.arange(20)))
    # Columns of a plane at some distance; what a column is in mm there plays no part.
    columns = 900 * 62.5 / distance_mm + pitch * x + 0.1 * y
    samples = ColumnSamples(np.stack([x, y], 1), columns, np.full(x.size, noise_px))
    expected = np.sqrt(0.03**2 + (0.01 * np.hypot(pitch, 0.1)) ** 2 + (3 * noise_px) ** 2)
    assert column_limit_px(samples) == pytest.approx(expected)


def test_positions_read_from_a_ruler_may_be_off_as_stated() -> None:
    ruler = [620.5, 739.2, 850.9]
    assert require_steps([620.0, 740.0, 850.0], ruler, 0.5) == pytest.approx(1.0, abs=3e-3)
    with pytest.raises(CalibrationError, match=r"position 740 mm is -1\.30 mm"):
        require_steps([620.0, 740.0, 850.0], ruler, 0.02)
    assert require_steps([700.0, 720.0], [700.0, 720.5], 0.5) == pytest.approx(1.025)
    for far_mm, std_mm in ((720.5, 0.02), (723.0, 0.5)):
        with pytest.raises(CalibrationError, match="times as far apart"):
            require_steps([700.0, 720.0], [700.0, far_mm], std_mm)


def test_steps_flatness_and_agreement_have_limits() -> None:
    at = [0.0, 100.0, 200.0]
    assert require_steps(at, np.array([600.0, 700.5, 801.0]), 0.02) == pytest.approx(1.005)
    with pytest.raises(CalibrationError, match=r"position 100 mm is \+2.00 mm"):
        require_steps(at, np.array([600.0, 702.0, 800.0]), 0.02)
    with pytest.raises(CalibrationError, match=r"1\.030 times as far apart"):
        require_steps(at, np.array([600.0, 703.0, 806.0]), 0.02)
    for towards in ([800.0, 700.0, 600.0], [800.0, 698.0, 600.0]):
        with pytest.raises(CalibrationError, match=r"0, 100, 200 mm .* 800\.0, .* counts towards the camera"):
            require_steps(at, np.array(towards), 0.02)
    require_plane(at, np.array([0.1, 0.49, 0.1]))
    with pytest.raises(CalibrationError, match=r"position 100 mm are 0\.51 px RMS off those of a plane"):
        require_plane(at, np.array([0.1, 0.51, 0.1]))
    slopes = np.array([[0.0, 0.02], [0.0, 0.02], [0.0, 0.02 + np.tan(np.radians(1.1))]])
    require_one_angle(at, slopes, np.array([0.1, 0.1, 0.49]))
    require_one_angle(at, slopes * 0.8, np.array([0.1, 0.1, 0.51]))
    with pytest.raises(CalibrationError, match=r"position 200 mm stands at an angle of 1\.1 degrees"):
        require_one_angle(at, slopes, np.array([0.1, 0.1, 0.51]))
    require_agreement(3.9, 1.0, 0.1, 1.0)
    with pytest.raises(CalibrationError, match=r"move by 4\.1 of"):
        require_agreement(4.1, 1.0, 0.1, 1.0)


def test_lenses_and_pose_move_along_the_root_of_their_covariance() -> None:
    root = 1e-3 * np.random.default_rng(1).standard_normal((SHARED, SHARED))
    stage = problem(root @ root.T)
    values = numbers()
    values[3] = 2.0
    assert stage.shared(values) == pytest.approx(shared_parameters(RIG) + 2.0 * stage.root[:, 3])
    assert stage.root @ stage.root.T == pytest.approx(root @ root.T)
    assert problem().shared(values) == pytest.approx(shared_parameters(RIG))
    assert stage.prior_weight[:SHARED].tolist() == [1.0] * SHARED
    assert stage.prior_weight[SHARED : SHARED + 3].tolist() == [0.0] * 3
    assert stage.prior_weight[GAIN:] == pytest.approx([1e4, 100, 100, 100])


@pytest.mark.parametrize(("tiles", "enough"), [(30, True), (29, False)])
def test_a_position_needs_thirty_tiles_and_a_stage_two_positions(tiles: int, enough: bool) -> None:
    part = ColumnSamples(np.zeros((tiles, 2)), np.zeros(tiles), np.ones(tiles))
    if enough:
        require_tiles([600.0, 700.0], [part, part])
        with pytest.raises(CalibrationError, match="at two or more positions, not 1"):
            require_tiles([600.0], [part])
    else:
        with pytest.raises(CalibrationError, match="position 600 mm only 29 tiles"):
            require_tiles([600.0, 700.0], [part, part])
