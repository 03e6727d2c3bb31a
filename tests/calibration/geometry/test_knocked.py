"""A camera that is knocked or zoomed between poses is named, with the poses; noise and bad prints are not."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from dsl_core.calibration.geometry.bundle import adjust
from dsl_core.calibration.geometry.knocked import Knock, knocked
from dsl_core.calibration.geometry.projector_corners import PoseObservation
from dsl_core.calibration.geometry.solve import calibrate_geometry, initial
from dsl_core.model.board import corner_positions_mm
from dsl_core.model.calibration.geometry import GeometryCalibration
from tests.cases import board_poses
from tests.cases.board_poses import BOARD, CAMERA, PROJECTOR, poses_seen

SIZES = (CAMERA.width_px, CAMERA.height_px), (PROJECTOR.width_px, PROJECTOR.height_px)


def _found(poses: Sequence[PoseObservation]) -> Knock | None:
    return knocked(poses, adjust(poses, initial(poses, *SIZES)).parameters)


def _calibrated(poses: Sequence[PoseObservation]) -> GeometryCalibration:
    return calibrate_geometry(poses, BOARD, *SIZES)


def _moved(pose: PoseObservation, across_px: float, zoom: float = 0.0) -> PoseObservation:
    """A pixel sees later what another one saw, with the same light of the projector."""
    away = pose.camera_px - np.array(SIZES[0]) / 2
    return replace(pose, camera_px=pose.camera_px + np.array([across_px, 0.0]) + zoom * away)


@pytest.mark.parametrize(("count", "at"), [(8, 4), (8, 1), (8, 7), (4, 2)])
def test_a_camera_knocked_by_half_a_pixel_is_named_with_the_poses(count: int, at: int) -> None:
    poses = [_moved(pose, 0.5 * (n >= at)) for n, pose in enumerate(poses_seen()[:count])]
    found = _found(poses)
    assert found is not None
    assert (found.before, found.after) == (f"pose_{at - 1}", f"pose_{at}")
    assert found.shift_px == pytest.approx((0.5, 0.0), abs=0.1)
    assert found.rms_px == pytest.approx(0.5, abs=0.1)
    sentences = [each for each in _calibrated(poses).warnings if "seems to have moved" in each]
    assert len(sentences) == 1
    assert sentences[0].startswith(f"Between pose_{at - 1} and pose_{at} the camera")


def test_a_zoom_of_one_per_cent_is_told() -> None:
    poses = [_moved(pose, 0.0, 0.01 * (n >= 5)) for n, pose in enumerate(poses_seen(0.15))]
    found = _found(poses)
    assert found is not None
    assert found.after == "pose_5"
    assert found.zoom == pytest.approx(0.01, abs=0.002)


@pytest.mark.parametrize("noise_px", [0.02, 0.05, 0.15, 0.4])
@pytest.mark.parametrize("seed", range(4))
def test_noise_is_no_knock(noise_px: float, seed: int) -> None:
    poses = poses_seen(noise_px, seed)
    assert _found(poses) is None
    assert not any("seems to have moved" in each for each in _calibrated(poses).warnings)


@pytest.mark.parametrize("seed", range(3))
def test_a_bad_print_and_a_bent_board_are_none(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    nominal = corner_positions_mm(BOARD)
    away = nominal - nominal.mean(0)
    wrong_mm = np.random.default_rng(seed).normal(0, 0.2, nominal.shape) * np.array([1.0, 1.0, 0.0])
    wrong_mm[:, 2] = 1.5 * (away**2).sum(1) / (away**2).sum(1).max()
    monkeypatch.setattr(board_poses, "corner_positions_mm", lambda board: nominal + wrong_mm)
    assert _found([replace(pose, board_mm=nominal) for pose in poses_seen(0.05, seed)]) is None


def test_rows_that_nobody_saw_count_for_nothing() -> None:
    poses = [_moved(pose, 0.5 * (n >= 4)) for n, pose in enumerate(poses_seen())]
    parameters = adjust(poses, initial(poses, *SIZES)).parameters
    columns = [replace(pose, projector_px=pose.projector_px * [1.0, np.nan]) for pose in poses]
    found = knocked(columns, parameters)
    assert found is not None
    assert found.after == "pose_4"
