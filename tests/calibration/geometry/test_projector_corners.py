"""Corners are found and looked up on the projector; what hinders it is named with the pose."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import cv2
import numpy as np
import pytest

from dsl_core.calibration.geometry.boards import Corners, find_corners, grey_of
from dsl_core.calibration.geometry.code_places import code_places
from dsl_core.calibration.geometry.pose_series import exposure_warning
from dsl_core.calibration.geometry.projector_corners import (
    corners_on_projector,
    observe_pose,
)
from dsl_core.errors import CalibrationError
from dsl_core.model.board import Charuco
from dsl_core.model.calibration.pose_frames import PoseFrames
from tests.cases.board_poses import SMALL_BOARD, SMALL_PROJECTOR_PX, board_frames, on_projector


@pytest.fixture(scope="module")
def frames() -> PoseFrames:
    return board_frames()


def _true_corners(turn: float = 0.1) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    v, u = np.mgrid[1:5, 1:6].reshape(2, -1) - np.array([[2.5], [3.0]])
    x, y = np.cos(turn) * u - np.sin(turn) * v, np.sin(turn) * u + np.cos(turn) * v
    return np.stack([x * 30 + 120, y * 30 + 90], 1)


def test_corners_are_where_they_were_drawn(frames: PoseFrames) -> None:
    seen = observe_pose(frames, SMALL_BOARD, SMALL_PROJECTOR_PX)
    assert len(seen.ids) == 20
    nearest = np.linalg.norm(seen.camera_px[:, None] - _true_corners()[None], axis=-1).min(1)
    assert nearest.max() < 0.1
    truth = np.stack(on_projector(seen.camera_px), 1)
    assert np.abs(seen.projector_px - truth).max() < 0.15


def test_undecided_pixels_are_done_without(frames: PoseFrames) -> None:
    rng = np.random.default_rng(1)
    code = code_places(frames, SMALL_PROJECTOR_PX)
    lost = rng.random(code.px.shape[1:]) < 0.5
    wrong = rng.random(code.px.shape[1:]) < 0.1
    px = np.where(lost, np.nan, code.px)
    px[0] += np.where(wrong, 64.0, 0.0)
    points = _true_corners()
    corners = Corners(np.arange(20), points)
    found, _ = corners_on_projector(frames, corners, SMALL_PROJECTOR_PX, replace(code, px=px))
    assert np.abs(found - np.stack(on_projector(points), 1)).max() < 0.2


@pytest.mark.slow
def test_a_mosaic_is_read_like_mono(frames: PoseFrames) -> None:
    gains = np.ones((180, 240))
    gains[::2, ::2], gains[1::2, 1::2] = 0.5, 0.7

    def mosaic(picture: np.ndarray[tuple[int, ...], np.dtype[np.uint8]]) -> object:
        return (picture * 16.0 * gains).astype(np.uint16)

    raw = PoseFrames(
        "raw", [mosaic(p) for p in frames.pairs], mosaic(frames.white), mosaic(frames.black), "RGGB"  # type: ignore[misc, arg-type]
    )  # fmt: skip
    mono, seen = (observe_pose(f, SMALL_BOARD, SMALL_PROJECTOR_PX) for f in (frames, raw))
    assert np.abs(mono.camera_px - seen.camera_px).max() < 0.1


def test_a_missing_board_names_the_pose() -> None:
    with pytest.raises(
        CalibrationError, match=r"5 x 4 inner corners was not found in the white picture of p7"
    ):
        observe_pose(board_frames("p7", board=False), SMALL_BOARD, SMALL_PROJECTOR_PX)


def _in_pairs(frames: PoseFrames, order: Callable[[list[object]], list[object]]) -> PoseFrames:
    pairs = order(list(zip(frames.pairs[::2], frames.pairs[1::2], strict=True)))
    return replace(frames, pairs=[p for pair in pairs for p in pair])  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    ("order", "words"),
    [
        (lambda pairs: [(b, a) for a, b in pairs], "every inverse comes before its pattern"),
        (lambda pairs: pairs[:7][::-1] + pairs[7:][::-1], "the least significant bit comes first"),
    ],
)
def test_a_wrong_order_of_patterns_is_told(
    frames: PoseFrames, order: Callable[[list[object]], list[object]], words: str
) -> None:
    with pytest.raises(CalibrationError, match=f"pose_0: .*It can be read if {words}"):
        observe_pose(_in_pairs(frames, order), SMALL_BOARD, SMALL_PROJECTOR_PX)


def test_patterns_before_inverses_are_told(frames: PoseFrames) -> None:
    wrong = replace(frames, pairs=[*frames.pairs[::2], *frames.pairs[1::2]])
    with pytest.raises(CalibrationError, match="all patterns come before all inverses"):
        observe_pose(wrong, SMALL_BOARD, SMALL_PROJECTOR_PX)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda f: replace(f, pairs=f.pairs[:-2]), "pose_0 has 26 pattern pictures; .* needs 28"),
        (lambda f: replace(f, white=f.black, black=f.white), "pose_0: the white picture is not brighter"),
        (lambda f: replace(f, black=f.black[:-1]), "pictures of pose_0 differ in size"),
        (
            lambda f: replace(f, white=np.where(f.white > 100, np.nan, f.white)),
            "pose_0 contain .* not finite",
        ),
    ],
)
def test_bad_pictures_name_the_pose(
    frames: PoseFrames, change: Callable[[PoseFrames], PoseFrames], words: str
) -> None:
    with pytest.raises(CalibrationError, match=words):
        observe_pose(change(frames), SMALL_BOARD, SMALL_PROJECTOR_PX)


@pytest.mark.parametrize("size_px", [(96, 128), (128, 65)])
def test_a_wrong_size_of_the_projector_is_told(frames: PoseFrames, size_px: tuple[int, int]) -> None:
    with pytest.raises(
        CalibrationError, match=r"pose_0: \d+% of the readable pixels .* outside a projector of"
    ):
        observe_pose(frames, SMALL_BOARD, size_px)


def test_over_exposure_is_told(frames: PoseFrames) -> None:
    seen = observe_pose(frames, SMALL_BOARD, SMALL_PROJECTOR_PX)
    assert exposure_warning(frames, seen) is None
    bright = replace(frames, white=(frames.white * 2.0).clip(0, 255).astype(np.uint8))
    assert (exposure_warning(bright, seen) or "").startswith("pose_0 is over-exposed")


def test_part_of_a_charuco_board_is_enough() -> None:
    board = Charuco(columns=8, rows=6, square_mm=20, marker_mm=15)
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_5X5_100)
    drawn = cv2.aruco.CharucoBoard((8, 6), 20.0, 15.0, dictionary).generateImage((640, 480))
    whole = cv2.copyMakeBorder(drawn, 40, 40, 40, 40, cv2.BORDER_CONSTANT, value=(255,))
    found = find_corners(grey_of(whole[:, :420]), board, "half a board")
    assert 12 <= len(found.ids) < 35
    expected = np.stack([found.ids % 7 + 1, found.ids // 7 + 1], 1) * 80.0 + 39.5
    assert np.abs(found.points_px - expected).max() < 0.2


def test_the_grey_of_an_even_mosaic_is_even() -> None:
    mosaic = np.tile([[100.0, 200.0], [200.0, 40.0]], (6, 8))
    np.testing.assert_allclose(grey_of(mosaic, "RGGB"), 0.25 * 100 + 0.5 * 200 + 0.25 * 40)


@pytest.mark.slow
def test_columns_alone_are_found_as_with_rows(frames: PoseFrames) -> None:
    known = observe_pose(frames, SMALL_BOARD, SMALL_PROJECTOR_PX)
    alone = observe_pose(replace(frames, pairs=frames.pairs[:14]), SMALL_BOARD, SMALL_PROJECTOR_PX)
    assert alone.columns_only
    assert not known.columns_only
    assert np.abs(alone.projector_px[:, 0] - known.projector_px[:, 0]).max() < 0.05
    assert np.abs(alone.slopes[:, 0] - known.slopes[:, 0]).max() < 0.05
    assert not alone.slopes[:, 1].any()


def test_a_code_of_columns_that_does_not_reach_the_board_is_told(frames: PoseFrames) -> None:
    dark = [np.where(np.arange(240) < 80, picture, 4) for picture in frames.pairs[:14]]
    lit = np.where(np.arange(240) < 80, frames.white, 0.5 * frames.white)
    with pytest.raises(CalibrationError, match=r"can be read around only \d+ of them\. Check that the"):
        observe_pose(replace(frames, pairs=dark, white=lit), SMALL_BOARD, SMALL_PROJECTOR_PX)
