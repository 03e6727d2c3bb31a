"""A projector known by its columns alone: what they tell comes back, the rest is assumed and said."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from dsl_core.calibration.geometry.bundle import rotation_of
from dsl_core.calibration.geometry.columns_only import start_from_columns
from dsl_core.calibration.geometry.projector_corners import PoseObservation
from dsl_core.calibration.geometry.solve import calibrate_geometry
from dsl_core.calibration.geometry.stage_planes import shared_parameters
from dsl_core.errors import CalibrationError
from dsl_core.model.calibration.geometry import GeometryCalibration
from tests.cases import board_poses
from tests.cases.board_poses import BOARD, CAMERA, CAMERA_PX, POSE, PROJECTOR, PROJECTOR_PX, TILTS, poses_seen

Floats = NDArray[np.float64]
#: What columns tell of the projector's lens and of the pose, and their places among the 24 parameters.
FX, CX, P1, TX, TY, TZ = 9, 11, 15, 21, 22, 23
TOLD = [*range(9), FX, CX, 13, 14, 16, 17, 18, 19, 20, TX, TZ]


def columns_of(poses: list[PoseObservation]) -> list[PoseObservation]:
    """The poses without rows of the projector."""
    alone = []
    for pose in poses:
        seen = pose.projector_px.copy()
        seen[:, 1] = np.nan
        alone.append(replace(pose, projector_px=seen))
    return alone


def calibrated(poses: list[PoseObservation], **more: Any) -> GeometryCalibration:
    return calibrate_geometry(poses, BOARD, CAMERA_PX, PROJECTOR_PX, **more)


def pulls(found: GeometryCalibration) -> Floats:
    """Errors of all parameters in stated deviations, zero where both are."""
    truth = found.model_copy(update={"camera": CAMERA, "projector": PROJECTOR, "pose": POSE})
    std = np.sqrt(np.diag(np.array(found.covariance).reshape(24, 24)))
    off = shared_parameters(found) - shared_parameters(truth)
    return np.divide(off, std, out=np.zeros(24), where=std > 0)


@pytest.fixture(scope="module")
def found() -> GeometryCalibration:
    return calibrated(columns_of(poses_seen()))


def test_exact_columns_give_the_exact_rig_but_for_what_they_do_not_tell() -> None:
    found = calibrated(columns_of(poses_seen(noise_px=0.0)))
    assert found.camera.fx_px == pytest.approx(1761.0, abs=1e-3)
    assert found.projector.fx_px == pytest.approx(PROJECTOR.fx_px, abs=0.01)
    assert found.projector.cx_px == pytest.approx(PROJECTOR.cx_px, abs=0.01)
    np.testing.assert_allclose(found.pose.vector_mm[[0, 2]], POSE.vector_mm[[0, 2]], atol=0.01)
    np.testing.assert_allclose(found.pose.matrix, POSE.matrix, atol=1e-4)
    assert found.projector_rms_px < 1e-4
    assert found.squares.square_mm == pytest.approx(30.0, abs=1e-3)


@pytest.mark.slow
def test_deviations_hold_of_what_is_told_and_of_what_is_assumed(found: GeometryCalibration) -> None:
    other = calibrated(columns_of(poses_seen(seed=1)))
    off = np.concatenate([pulls(each)[TOLD] for each in (found, other)])
    assert np.abs(off).max() < 4
    assert 0.4 < np.sqrt((off**2).mean()) < 1.5
    assert np.abs([pulls(each) for each in (found, other)]).max() < 4


def test_what_is_assumed_is_said_with_its_deviation(found: GeometryCalibration) -> None:
    assert found.columns_only
    assert found.projector.fy_px == found.projector.fx_px
    assert found.projector.cy_px == (PROJECTOR_PX[1] - 1) / 2
    assert found.projector_deviation.cy_px == pytest.approx(360 * 2 / 12**0.5)
    assert found.projector_deviation.fy_px > 0.01 * found.projector.fx_px
    # From 900 to 1180 mm away: as high as the camera within a fifth of that, but for what the lens tells.
    assert 20 < found.pose_deviation.translation_mm[1] < 210
    assert found.pose_deviation.translation_mm[0] < 0.2
    assert found.warnings[0].startswith("Only columns of the projector were seen.")
    assert f"(cy {found.projector.cy_px:.0f} ± 208 px)" in found.warnings[0]
    assert not calibrated(poses_seen()).columns_only


def test_errors_and_coverage_are_those_of_columns(found: GeometryCalibration) -> None:
    assert found.projector_rms_px == pytest.approx(0.05 / np.sqrt(2), rel=0.1)
    assert found.projector_coverage == 0.75
    assert all(pose.left_out is not None for pose in found.poses)


@pytest.mark.slow
def test_misread_columns_do_no_harm() -> None:
    poses = columns_of(poses_seen())
    for index, pose in enumerate(poses):
        pose.projector_px[index * 5, 0] += 200.0
    found = calibrated(poses)
    assert np.abs(pulls(found)).max() < 4
    assert [pose.outliers for pose in found.poses] == [1] * len(poses)


@pytest.mark.slow
def test_terms_that_are_held_stay_zero() -> None:
    found = calibrated(columns_of(poses_seen()), hold=("k3", "tangential"))
    assert found.projector.distortion[2:] == found.camera.distortion[2:] == (0.0, 0.0, 0.0)
    assert found.projector_deviation.distortion[2:] == (0.0, 0.0, 0.0)


def test_the_start_is_linear_and_needs_no_guess() -> None:
    rng = np.random.default_rng(3)
    boards = np.array(
        [[*rng.uniform(-0.5, 0.5, 3), *rng.uniform(-50, 50, 2), 800.0 + 60 * k] for k in range(4)]
    )
    turn, shift = rotation_of(np.array([0.1, -0.4, 0.6])), np.array([-150.0, 30.0, 40.0])
    poses = []
    for pose, motion in zip(poses_seen()[:4], boards, strict=True):
        there = (pose.board_mm @ rotation_of(motion[:3]).T + motion[3:]) @ turn.T + shift
        seen = np.stack([700 * there[:, 0] / there[:, 2] + 300, np.full(len(there), np.nan)], 1)
        seen[7, 0] = 5.0
        poses.append(replace(pose, projector_px=seen))
    lens, stereo = start_from_columns(poses, boards, (640, 360))
    np.testing.assert_allclose(lens[:4], [700, 700, 300, 179.5], rtol=1e-3)
    np.testing.assert_allclose(rotation_of(stereo[:3]), turn, atol=1e-3)
    np.testing.assert_allclose(stereo[[3, 5]], shift[[0, 2]], atol=0.5)


def test_rows_in_the_place_of_columns_are_told() -> None:
    poses = [replace(pose, projector_px=pose.projector_px[:, ::-1].copy()) for pose in poses_seen()]
    with pytest.raises(CalibrationError, match=r"In pose_0, .* run down the camera's picture.*rows of"):
        calibrated(columns_of(poses))


def _mirrored(pose: PoseObservation) -> PoseObservation:
    seen = pose.projector_px.copy()
    seen[:, 0] = PROJECTOR_PX[0] - 1 - seen[:, 0]
    return replace(pose, projector_px=seen)


def test_a_pose_that_is_mirrored_unlike_the_others_is_named() -> None:
    poses = columns_of(poses_seen())
    poses[2] = _mirrored(poses[2])
    with pytest.raises(CalibrationError, match="In pose_2 the columns rise the other way"):
        calibrated(poses)


@pytest.mark.slow
def test_a_projector_that_is_mirrored_or_upside_down_is_doubted() -> None:
    found = calibrated([_mirrored(pose) for pose in columns_of(poses_seen())])
    assert any("rise from right to left" in each for each in found.warnings)
    assert found.projector_rms_px == pytest.approx(0.05 / np.sqrt(2), rel=0.1)


def test_poses_that_differ_in_what_they_show_are_named() -> None:
    poses = poses_seen()
    poses[1] = columns_of(poses)[1]
    with pytest.raises(CalibrationError, match="pose_1 has only columns of the projector, the other"):
        calibrated(poses)


@pytest.mark.parametrize(
    ("poses", "words"),
    [
        (columns_of(poses_seen(tilts=[(0.02, 0.0)] * 6)), "nearly parallel"),
        (columns_of(poses_seen())[:1], "1 usable poses of the board are too few"),
    ],
)
def test_poses_that_say_too_little_are_refused(poses: list[PoseObservation], words: str) -> None:
    with pytest.raises(CalibrationError, match=words):
        calibrated(poses)


@pytest.mark.slow
def test_devices_that_stand_one_above_the_other_are_doubted(monkeypatch: pytest.MonkeyPatch) -> None:
    above = POSE.model_copy(update={"translation_mm": (0.5, -200.0, 0.0)})
    monkeypatch.setattr(board_poses, "POSE", above)
    found = calibrated(columns_of(poses_seen(tilts=TILTS[:5])))
    assert any("stand one above the other, along the stripes" in each for each in found.warnings)
