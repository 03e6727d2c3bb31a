"""What poses of a board leave unsure is measured before the fit and said after it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dsl_core.calibration.geometry.bundle import rotation_of
from dsl_core.calibration.geometry.pose_series import (
    board_normal,
    check_poses,
    coverage,
    doubts,
    largest_angle_deg,
    largest_tilt_deg,
    picture_gamma,
)
from dsl_core.calibration.geometry.solve import calibrate_geometry
from dsl_core.errors import CalibrationError
from dsl_core.model.board import corner_positions_mm
from dsl_core.model.calibration.geometry import GeometryCalibration
from dsl_core.optics.pinhole import project
from tests.cases import board_poses as case


@pytest.fixture(scope="module")
def found() -> GeometryCalibration:
    return calibrate_geometry(case.poses_seen(), case.BOARD, case.CAMERA_PX, case.PROJECTOR_PX)


def test_coverage_is_the_share_of_cells_with_a_corner() -> None:
    size = (80, 80)
    assert coverage(np.array([[5.0, 5.0], [6.0, 4.0], [15.0, 5.0]]), size) == pytest.approx(2 / 64)
    everywhere = np.stack(np.meshgrid(np.arange(80.0), np.arange(80.0)), -1).reshape(-1, 2)
    assert coverage(everywhere, size) == 1.0
    assert coverage(np.array([[-3.0, 5.0], [90.0, 5.0]]), size) == 0.0


def test_normals_come_from_corners_alone() -> None:
    board = corner_positions_mm(case.BOARD)
    turn = rotation_of(np.array([0.3, -0.2, 0.1]))
    points = board @ turn.T + [10.0, 20.0, 800.0]
    lens = case.CAMERA.model_copy(update={"distortion": (0.0,) * 5})
    matrix = np.array([[lens.fx_px, 0, lens.cx_px], [0, lens.fy_px, lens.cy_px], [0, 0, 1]])
    normal = board_normal(board, np.stack(project(lens, *points.T), 1), matrix, "pose")
    assert abs(normal @ turn[:, 2]) == pytest.approx(1.0, abs=1e-9)
    with pytest.raises(CalibrationError, match="one line"):
        board_normal(board[:9], np.stack([np.arange(9.0), np.zeros(9)], 1), matrix, "pose")


def test_the_largest_angle_is_that_of_two_planes() -> None:
    angles = np.radians([0.0, 20.0, -15.0])
    normals = np.stack([np.sin(angles), np.zeros(3), np.cos(angles)], 1) * [[1], [-1], [1]]
    assert largest_angle_deg(normals) == pytest.approx(35.0)
    # From corners, with a typical focal length instead of the true one.
    assert largest_tilt_deg(case.poses_seen(), case.CAMERA_PX) == pytest.approx(57.0, abs=12.0)


def test_poses_that_suffice_pass_and_doubts_name_what_is_poor(found: GeometryCalibration) -> None:
    check_poses(case.poses_seen(), case.CAMERA_PX)
    good = found.model_copy(update={"camera_coverage": 0.6, "projector_coverage": 0.6})
    assert not any("cover" in sentence for sentence in doubts(good, 40.0, None))
    poor = good.model_copy(
        update={
            "camera_coverage": 0.2,
            "rms_px": 0.8,
            "projector": found.projector.model_copy(update={"fy_px": 1.1 * found.projector.fx_px}),
            "camera_deviation": found.camera_deviation.model_copy(
                update={"fx_px": 0.05 * found.camera.fx_px}
            ),
            "poses": (found.poses[0].model_copy(update={"used": False}), *found.poses[1:]),
        }
    )
    sentences = doubts(poor, 10.0, None)
    for words in (
        "pose_0 does not fit",
        "Corners cover 20% of the camera's",
        "focal length of the camera is known only to 5.0%",
        "The projector seems to have oblong pixels",
        "reprojection error of 0.80 px is large",
        "tilted by 10 degrees at most",
    ):
        assert sum(words in sentence for sentence in sentences) == 1, words


def test_distortion_that_the_board_leaves_open_counts_in_the_corner(found: GeometryCalibration) -> None:
    lens = found.camera
    corner = np.hypot(
        max(lens.cx_px, lens.width_px - 1 - lens.cx_px) / lens.fx_px,
        max(lens.cy_px, lens.height_px - 1 - lens.cy_px) / lens.fy_px,
    )
    for px, told in ((2.0, True), (0.9, False)):
        covariance = np.diag(np.full(24, 1e-12))
        covariance[8, 8] = (px / (lens.fx_px * corner**7)) ** 2
        unsure = found.model_copy(update={"covariance": tuple(covariance.ravel().tolist())})
        sentences = [each for each in doubts(unsure, 40.0, None) if "distortion of the camera" in each]
        assert bool(sentences) == told
        assert not told or ": 2.0 px in a corner" in sentences[0]


def test_another_known_length_tells_a_wrong_printed_size(found: GeometryCalibration) -> None:
    baseline = float(np.linalg.norm(found.pose.translation_mm))
    assert not any("printed squares" in each for each in doubts(found, 40.0, 1.05 * baseline))
    (sentence,) = (each for each in doubts(found, 40.0, 1.2 * baseline) if "printed squares" in each)
    assert "probably 36.0 mm, not 30 mm" in sentence


@pytest.mark.parametrize("gamma", [1.0, 0.45])
def test_the_gamma_is_that_of_bright_places_where_stripes_cross_a_pixel(gamma: float) -> None:
    linear = case.board_frames()

    def pictured(picture: np.ndarray) -> np.ndarray:
        light = (picture - 4.0).clip(0) / 200.0
        # A camera that loses its darkest counts: dark squares would say nothing of its gamma.
        return np.asarray(1000 * np.where(light < 0.15, 0.0, light**gamma) + 10)

    frames = replace(
        linear,
        pairs=[pictured(picture) for picture in linear.pairs],
        white=pictured(linear.white) + np.where(linear.white < 40, 3.0, 0.0),
        black=pictured(linear.black),
    )
    assert picture_gamma(frames, case.SMALL_PROJECTOR_PX) == pytest.approx(gamma, abs=0.06)


@pytest.mark.parametrize(("tilt_deg", "enough"), [(4.0, False), (7.0, True)])
def test_poses_five_degrees_apart_are_enough(tilt_deg: float, enough: bool) -> None:
    turn = np.radians(tilt_deg)
    tilts = ((0.0, 0.0), (turn, 0.0), (0.0, 0.0), (turn, 0.0), (0.0, 0.0), (turn, 0.0))
    poses = case.poses_seen(0.0, tilts=tilts)
    if enough:
        check_poses(poses, case.CAMERA_PX)
    else:
        with pytest.raises(CalibrationError, match="nearly parallel"):
            check_poses(poses, case.CAMERA_PX)
