"""Squares that are printed wider than high are told, and no pose is left out for showing it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dsl_core.calibration.geometry.bundle import adjust, rotation_of
from dsl_core.calibration.geometry.projector_corners import PoseObservation
from dsl_core.calibration.geometry.solve import calibrate_geometry, initial
from dsl_core.calibration.geometry.stretched import looks_turned, stretched, with_stretch
from dsl_core.model.board import Checkerboard
from dsl_core.optics.pinhole import project
from tests.cases.board_poses import BOARD, CAMERA, CAMERA_PX, POSE, PROJECTOR, PROJECTOR_PX, poses_seen

SIZES = (CAMERA_PX, PROJECTOR_PX)
#: About the camera's axis, rad, so that edges are as nearly across and down as a person holds a board.
UPRIGHT, TURNED = 0.0, np.pi / 2


def _pose(index: int, tilt: tuple[float, float], roll: float, stretch: float) -> PoseObservation:
    """Corners of a board that is wider than it is believed to be, with noise."""
    believed = poses_seen()[0].board_mm
    printed = (believed - believed.mean(0)) * [1 + stretch / 2, 1 - stretch / 2, 1.0]
    turn = rotation_of(np.array([*tilt, 0.0])) @ rotation_of(np.array([0.0, 0.0, roll]))
    shift = np.array([30.0 * (index % 3 - 1), 20.0 * (index % 2) - 10, 900.0 + 40 * index])
    points = printed @ turn.T + shift
    noise = np.random.default_rng(index).normal(0, 0.05, (2, len(believed), 2))
    camera = np.stack(project(CAMERA, *points.T), 1)
    projector = np.stack(project(PROJECTOR, *(points @ POSE.matrix.T + POSE.vector_mm).T), 1)
    ids = np.arange(len(believed))
    return PoseObservation(f"pose_{index}", ids, believed, camera + noise[0], projector + noise[1])


def _poses(stretch: float, last_roll: float) -> list[PoseObservation]:
    tilts = [(0.0, 0.0), (0.5, 0.0), (-0.5, 0.0), (0.0, 0.5), (0.0, -0.5), (0.5, 0.0), (0.3, 0.3)]
    rolls = [UPRIGHT] * (len(tilts) - 1) + [last_roll]
    return [
        _pose(index, tilt, roll, stretch) for index, (tilt, roll) in enumerate(zip(tilts, rolls, strict=True))
    ]


@pytest.mark.parametrize("stretch", [0.01, -0.03])
def test_the_pose_that_shows_it_is_kept_and_the_lenses_are_right(stretch: float) -> None:
    found = calibrate_geometry(_poses(stretch, TURNED), BOARD, *SIZES)
    assert all(pose.used for pose in found.poses)
    (told,) = [each for each in found.warnings if "printed squares" in each]
    assert ("wider than high" if stretch > 0 else "higher than wide") in told
    for name in ("fx_px", "fy_px"):
        off = getattr(found.camera, name) - getattr(CAMERA, name)
        assert abs(off) < 4 * getattr(found.camera_deviation, name)
    assert found.pose.translation_mm[0] == pytest.approx(POSE.translation_mm[0], abs=0.2)


@pytest.mark.parametrize("noise_px", [0.02, 0.05, 0.15, 0.4])
@pytest.mark.parametrize("seed", range(3))
def test_noise_is_no_stretch(noise_px: float, seed: int) -> None:
    poses = poses_seen(noise_px, seed)
    assert stretched(poses, adjust(poses, initial(poses, *SIZES))) is None


@pytest.mark.parametrize("noise_px", [0.02, 0.15])
def test_its_size_is_found(noise_px: float) -> None:
    poses = [with_stretch(pose, -0.02) for pose in poses_seen(noise_px)]
    found = stretched(poses, adjust(poses, initial(poses, *SIZES)))
    assert found is not None
    assert found.share == pytest.approx(0.02, abs=0.001)


def test_a_pose_in_which_the_board_moved_is_no_stretch() -> None:
    poses = _poses(0.0, TURNED)
    poses[-1] = replace(poses[-1], projector_px=poses[-1].projector_px + np.array([1.5, 0.5]))
    found = calibrate_geometry(poses, BOARD, *SIZES)
    assert [pose.used for pose in found.poses] == [True] * 6 + [False]
    assert not any("printed squares" in each for each in found.warnings)


def test_a_board_that_may_lie_on_its_side_is_not_judged(monkeypatch: pytest.MonkeyPatch) -> None:
    poses = [with_stretch(pose, -0.02) for pose in poses_seen()]
    assert any("printed squares" in each for each in calibrate_geometry(poses, BOARD, *SIZES).warnings)
    monkeypatch.setattr("dsl_core.calibration.geometry.solve.looks_turned", lambda board: True)
    assert not any("printed squares" in each for each in calibrate_geometry(poses, BOARD, *SIZES).warnings)
    assert looks_turned(Checkerboard(columns=7, rows=7, square_mm=30.0))
    assert not looks_turned(BOARD)
