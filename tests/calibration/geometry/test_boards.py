"""Pictures become grey, corners are found and refined to where edges cross, and saturation is told."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dsl_core.calibration.geometry.boards import (
    SATURATED_SHARE,
    Corners,
    _bends_per_px,
    _eight_bit,
    _exposure_hint,
    _full_light,
    _nearest_known,
    find_corners,
    grey_of,
    other_board,
    pitches_px,
    refine_corners,
    saturated,
)
from dsl_core.errors import CalibrationError
from dsl_core.model.board import Charuco, Checkerboard, corner_positions_mm
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


@pytest.mark.slow
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


@pytest.mark.parametrize("name", ["DICT_APRILTAG_36h11", "DICT_APRILTAG_36H11", "DICT_ARUCO_MIP_36h12"])
def test_markers_are_named_in_either_spelling_of_opencv(name: str) -> None:
    board = Charuco(columns=8, rows=6, square_mm=20.0, marker_mm=15.0, dictionary=name)
    assert board == Charuco.model_validate_json(board.model_dump_json())
    assert board.dictionary == name.upper()
    flat = np.full((120, 160), 50.0, np.float32)
    with pytest.raises(CalibrationError, match="was not found in pose 3"):
        find_corners(flat, board, "pose 3")


def test_squares_counted_in_place_of_corners_are_told() -> None:
    squares = np.kron(np.indices((6, 8)).sum(0) % 2, np.ones((24, 24)))
    picture = np.pad(squares, 30, constant_values=1).astype(np.float32)
    told = other_board(picture, Checkerboard(columns=8, rows=6, square_mm=10))
    assert told.startswith(" A board of 7 x 5 inner corners is seen instead: count the places")
    assert other_board(np.ones((60, 80), np.float32), Checkerboard(columns=8, rows=6, square_mm=10)) == ""
    assert other_board(picture, Charuco(columns=8, rows=6, square_mm=10, marker_mm=7)) == ""


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


def test_white_light_is_the_mean_of_all_pairs_and_white_above_black() -> None:
    white, black = np.full((2, 3), 900.0), np.full((2, 3), 100.0)
    pairs = [np.full((2, 3), value) for value in (700.0, 300.0, 500.0, 520.0)]
    # Each pair gives white and black once more: (800 + 800 + 820) / 3 above black.
    found = _full_light(PoseFrames("pose", pairs, white, black))
    assert found == pytest.approx(np.full((2, 3), (800 + 800 + 820) / 3))


@pytest.mark.parametrize("full", [255, 1023, 4095, 16383, 65535])
def test_white_is_saturated_near_the_end_of_its_scale(full: int) -> None:
    white = np.full((2, 2), full // 2, np.uint16)
    white[0, 0], white[0, 1] = full, int(SATURATED_SHARE * full) - 1
    black = np.zeros((2, 2), np.uint16)
    wanted = [[True, False], [False, False]]
    assert saturated(PoseFrames("pose", (), white, black)).tolist() == wanted
    colours = np.stack([white, white * 0, white * 0], 2)
    assert saturated(PoseFrames("pose", (), colours, black)).tolist() == wanted


def test_detectors_see_bytes_up_to_all_but_the_brightest_thousandth() -> None:
    grey = np.linspace(0, 1000, 10_001, dtype=np.float32).reshape(1, -1)
    found = _eight_bit(grey)
    assert found.tolist() == np.clip(np.round(grey * (255 / 999.0)), 0, 255).astype(np.uint8).tolist()
    assert _eight_bit(np.zeros((3, 3), np.float32)).max() == 0


def test_over_exposure_and_lack_of_contrast_are_told() -> None:
    flat = np.full((10, 10), 100, np.uint8)
    bright = np.linspace(0, 1, 100, dtype=np.float32).reshape(10, 10)
    assert "hardly any contrast" in _exposure_hint(flat, bright)
    steps = np.where(np.arange(100).reshape(10, 10) % 2, 94, 106).astype(np.uint8)
    assert _exposure_hint(steps, bright) == ""
    assert "hardly any contrast" in _exposure_hint(np.where(steps > 100, 104, 96).astype(np.uint8), bright)
    for clipped, is_told in ((20, False), (21, True)):
        part = bright.copy()
        part.ravel()[-clipped:] = 5.0
        assert ("A fifth of the picture" in _exposure_hint(steps, part)) == is_told


def test_what_a_corner_lacks_is_that_of_the_nearest() -> None:
    places = np.array([[0, 0], [1, 0], [5, 0], [0, 3]])
    values = np.array([[1.0, 10.0], [np.nan, 20.0], [3.0, np.nan], [np.nan, np.nan]])
    found = _nearest_known(places, values, np.isfinite(values))
    assert found.tolist() == [[1.0, 10.0], [1.0, 20.0], [3.0, 20.0], [1.0, 10.0]]
    assert _nearest_known(places, values, np.zeros((4, 2), bool)).tolist() == [[0, 0]] * 4


def test_the_nearest_corner_gives_the_pitch() -> None:
    assert pitches_px(np.array([[0.0, 0.0], [3.0, 4.0], [3.0, 5.0]])).tolist() == [5.0, 1.0, 1.0]


def test_edges_bend_by_the_curvature_of_three_corners() -> None:
    board = Checkerboard(columns=5, rows=4, square_mm=10.0)
    ids = np.arange(len(corner_positions_mm(board)))
    x, y = np.rint(corner_positions_mm(board)[:, :2] / 10).astype(int).T
    # Edges along x are circles of radius 500 px about a point below; those along y are straight.
    points = np.stack([30.0 * x, 20.0 * y + (30.0 * x) ** 2 / 1000], 1)
    found = _bends_per_px(Corners(ids, points), board)
    inner = (x > x.min()) & (x < x.max())
    slope = 2 * 30.0 * x[inner] / 1000
    assert found[inner, 0] == pytest.approx((1 / 500) / (1 + slope**2) ** 1.5, rel=1e-6)
    assert found[:, 1] == pytest.approx(np.zeros(len(ids)), abs=1e-12)
    assert np.isfinite(found).all()


def test_corners_of_an_enlarged_picture_stay_where_they_are(monkeypatch: pytest.MonkeyPatch) -> None:
    import cv2

    places = np.stack(np.meshgrid(8 * np.arange(5) + 9, 8 * np.arange(4) + 7), -1).reshape(-1, 2)
    # The first two pixels of a row of the enlarged picture are the first one's, whose middle is at 0.
    in_enlarged = (2 * places + 0.5).astype(np.float32)[:, None]

    def found(picture: np.ndarray, *_: object, **__: object) -> tuple[bool, np.ndarray | None]:
        is_enlarged = picture.shape == (96, 128)
        return is_enlarged, in_enlarged if is_enlarged else None

    monkeypatch.setattr(cv2, "findChessboardCornersSB", found)
    monkeypatch.setattr("dsl_core.calibration.geometry.boards._refined", lambda _, at: at)
    corners = find_corners(np.tile(np.arange(64.0, dtype=np.float32), (48, 1)), SMALL_BOARD, "the picture")
    assert corners.points_px == pytest.approx(places)


def test_a_board_in_a_small_picture_is_found_with_squares_of_four_pixels() -> None:
    import cv2

    board, fine = Checkerboard(columns=11, rows=7, square_mm=20.0), 16
    drawn = np.kron(np.indices((10, 14)).sum(0) % 2, np.ones((fine, fine)))
    drawn[:fine] = drawn[-fine:] = 1
    drawn[:, :fine] = drawn[:, -fine:] = 1
    # Tilted, and drawn eight times as large first.
    corners = np.array([[9.8, 5.6], [68.6, 11.9], [64.4, 51.8], [6.3, 56.0]], np.float32)
    size = np.array(drawn.shape[::-1], np.float32)
    outline = np.array([[0, 0], [size[0], 0], size, [0, size[1]]], np.float32) - 0.5
    to_picture = cv2.getPerspectiveTransform(outline, corners)
    enlarged = np.array([[8.0, 0, 3.5], [0, 8, 3.5], [0, 0, 1]]) @ to_picture
    large = cv2.warpPerspective(drawn.astype(np.float32), enlarged, (8 * 80, 8 * 64), borderValue=1.0)
    small = cv2.resize(cv2.GaussianBlur(large, (0, 0), 5), (80, 64), interpolation=cv2.INTER_AREA)
    grey = (100 + 900 * small + np.random.default_rng(0).normal(0, 8, small.shape)).astype(np.float32)

    places = (
        np.stack(np.meshgrid(np.arange(2, 13), np.arange(2, 9)), -1).reshape(-1, 1, 2) * float(fine) - 0.5
    )
    true = cv2.perspectiveTransform(places, to_picture)[:, 0]
    found = find_corners(grey, board, "the picture").points_px
    off = min(np.abs(found - each).max() for each in (true, true[::-1]))
    assert off < 0.4


def test_a_board_that_is_turned_is_no_other_board() -> None:
    # 6 x 5 inner corners, as stated, and upright in the picture.
    squares = np.kron(np.indices((7, 6)).sum(0) % 2, np.ones((24, 24)))
    picture = np.pad(squares, 30, constant_values=1).astype(np.float32)
    assert other_board(picture, Checkerboard(columns=6, rows=5, square_mm=10)) == ""
    assert other_board(picture, Checkerboard(columns=6, rows=6, square_mm=10)).startswith(" A board of 6 x 5")
