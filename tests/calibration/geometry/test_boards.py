"""Pictures become grey, corners are found and refined to where edges cross, and saturation is told."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dsl_core.calibration.geometry.boards import (
    Corners,
    _nearest_known,
    find_corners,
    grey_of,
    pitches_px,
    refine_corners,
    saturated,
)
from dsl_core.errors import CalibrationError
from dsl_core.model.board import Charuco
from dsl_core.model.calibration.pose_frames import PoseFrames
from tests.cases.board_poses import SMALL_BOARD, board_frames
from tests.cases.board_twin import BOARD, TILTED, TILTED_SIZE_PX, true_corners


def test_grey_is_one_value_a_pixel() -> None:
    mono = np.arange(12.0).reshape(3, 4)
    assert (grey_of(mono) == mono).all()
    assert (grey_of(np.stack([mono, 2 * mono, 6 * mono], 2)) == 3 * mono).all()
    assert grey_of(np.full((6, 6), 7.0), "RGGB") == pytest.approx(np.full((6, 6), 7.0))


def test_saturation_is_the_end_of_the_scale_that_the_values_show() -> None:
    white = np.full((4, 4), 1000, np.uint16)
    white[0, 0] = 4095
    frames = PoseFrames("pose", (), white, np.zeros((4, 4), np.uint16))
    assert np.argwhere(saturated(frames)).tolist() == [[0, 0]]
    # Eight bits: 255 is the end.
    eight = replace(frames, white=np.where(white > 4000, 255, 200))
    assert saturated(eight).sum() == 1
    # Merged pictures have no end; they say themselves.
    assert not saturated(replace(frames, white=white.astype(float))).any()
    assert saturated(replace(frames, saturated=np.ones((4, 4), bool))).all()


def test_pitches_are_distances_to_the_nearest_corner() -> None:
    points = np.array([[0.0, 0.0], [3.0, 4.0], [30.0, 0.0]])
    assert pitches_px(points) == pytest.approx([5.0, 5.0, np.hypot(27, 4)])


def test_corners_are_numbered_along_rows_and_found_below_a_tenth_of_a_pixel() -> None:
    found = find_corners(grey_of(board_frames().white), SMALL_BOARD, "the picture")
    assert found.ids.tolist() == list(range(20))
    steps = np.diff(found.points_px.reshape(4, 5, 2), axis=1)
    assert np.linalg.norm(steps, axis=2) == pytest.approx(np.full((4, 4), 30.0), abs=0.15)


def test_markers_close_to_a_corner_do_not_draw_it() -> None:
    """Squares of 18 px leave two pixels between a corner and the markers beside it."""
    import cv2

    board = Charuco(columns=8, rows=6, square_mm=20.0, marker_mm=15.0, dictionary="DICT_5X5_100")
    drawn = cv2.aruco.CharucoBoard(
        (8, 6), 20.0, 15.0, cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_5X5_100)
    )
    large, fine, scale = drawn.generateImage((1280, 960), None, 0).astype(np.float32), 8, 18 / 160
    to_picture = np.array([[scale, 0.02 * scale, 12.9], [-0.02 * scale, scale, 15.0]])
    to_fine = fine * to_picture
    to_fine[:, 2] += (fine - 1) / 2
    seen = cv2.warpAffine(large, to_fine, (171 * fine, 135 * fine), borderValue=(255.0,))
    grey = cv2.GaussianBlur(seen.reshape(135, fine, 171, fine).mean((1, 3)), (0, 0), 0.6)
    found = find_corners(np.asarray(grey, np.float32), board, "the picture")
    corners = np.stack([found.ids % 7 + 1, found.ids // 7 + 1], 1) * 160 - 0.5
    error = found.points_px - (corners @ to_picture[:, :2].T + to_picture[:, 2])
    assert len(found.ids) >= 12
    assert np.sqrt((error**2).mean()) < 0.1


def test_refining_brings_corners_to_where_edges_cross(frames: PoseFrames) -> None:
    truth, _ = true_corners(TILTED, TILTED_SIZE_PX)
    rough = Corners(np.arange(77), truth + np.random.default_rng(0).uniform(-0.3, 0.3, truth.shape))
    refined, blur_px = refine_corners(frames, rough, BOARD)
    assert np.abs(rough.points_px - truth).max() > 0.25
    assert np.sqrt(np.mean((refined.points_px - truth) ** 2)) < 0.02
    assert 0.1 < blur_px < 1.0


def test_a_board_that_is_not_there_and_unknown_markers_are_named() -> None:
    flat = np.full((120, 160), 50.0, np.float32)
    with pytest.raises(CalibrationError, match=r"5 x 4 inner corners was not found in pose 3 \(no corners\)"):
        find_corners(flat, SMALL_BOARD, "pose 3")
    with pytest.raises(CalibrationError, match="equally bright"):
        find_corners(np.where(np.arange(160) < 80, 9.0, 1.0) * np.ones((120, 1)), SMALL_BOARD, "pose 3")  # type: ignore[arg-type]
    odd = Charuco(columns=8, rows=6, square_mm=20.0, marker_mm=15.0, dictionary="DICT_9X9_7")
    with pytest.raises(CalibrationError, match="'DICT_9X9_7'"):
        find_corners(flat, odd, "pose 3")


def test_what_is_unknown_is_taken_from_the_nearest_corner_of_the_board() -> None:
    places = np.array([[0, 0], [1, 0], [2, 2], [5, 1], [0, 4]])
    values = np.array([[1.0, 0.0], [0.0, 2.0], [3.0, 0.0], [0.0, 0.0], [5.0, 0.0]])
    known = np.array([[True, False], [False, True], [True, False], [False, False], [True, False]])
    # Distances squared of (5, 1) along x: 26, 10 to (2, 2), 34; of (1, 0): 1, 5, 17.
    assert _nearest_known(places, values, known).tolist() == [
        [1.0, 2.0], [1.0, 2.0], [3.0, 2.0], [3.0, 2.0], [5.0, 2.0],
    ]  # fmt: skip
    none = np.zeros_like(known)
    assert not _nearest_known(places, values, none).any()
    # Nearer to what is left of it, and below, than to what is right of it.
    row = np.array([[-3, 0], [0, 0], [2, 0], [0, -1]])
    at = np.array([[1.0, 1.0], [0.0, 0.0], [2.0, 2.0], [4.0, 4.0]])
    one = np.array([[True, True], [False, False], [True, True], [False, False]])
    assert _nearest_known(row, at, one)[1].tolist() == [2.0, 2.0]
    one[3] = True
    assert _nearest_known(row, at, one)[1].tolist() == [4.0, 4.0]
