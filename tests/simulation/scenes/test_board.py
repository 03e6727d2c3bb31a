"""The printed board: where it stands, edges with shares of both materials, markers that OpenCV reads."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from dsl_core.calibration.geometry.boards import find_corners, refine_corners
from dsl_core.errors import PlanError
from dsl_core.model.board import Charuco, corner_positions_mm
from dsl_core.model.calibration.pose_frames import PoseFrames
from dsl_core.optics.pinhole import project
from dsl_core.simulation.published_rig import published_rig
from dsl_core.simulation.scenes.board import INK, PAPER, printed_board
from dsl_core.simulation.scenes.catalogue import SceneTruth, make_scene

CENTRE = published_rig().pose.projector_centre_mm
CAMERA = published_rig().camera.resized(445, 290)


def see(**options: float | str) -> SceneTruth:
    return make_scene("board", **options).render(CAMERA, CENTRE)


def albedo(truth: SceneTruth) -> NDArray[np.float64]:
    """Reflectance of every pixel, mixed ones as the sum of their shares."""
    pixel, material, share = truth.parts()
    value = truth.materials.at(np.array([550.0]))[material, 0] * share
    return np.asarray(np.bincount(pixel, value, truth.depth_mm.size).reshape(truth.depth_mm.shape), float)


@pytest.mark.slow
def test_shares_of_a_pixel_sum_to_one() -> None:
    truth = see(roll_deg=7)
    pixel, _, share = truth.parts()
    np.testing.assert_allclose(np.bincount(pixel, share), 1.0)
    assert truth.mixed is not None
    assert len(truth.mixed.pixels) > 3000
    assert 0 < truth.mixed.share.min() <= truth.mixed.share.max() <= 0.5


def test_a_mixed_pixel_holds_the_area_of_the_ink() -> None:
    """Squares along the pixel grid: the ink of each follows from its size to a hundredth of a pixel."""
    lens = CAMERA.model_copy(update={"distortion": (0.0,) * 5})
    truth = make_scene("board", x_mm=0, y_mm=0, depth_mm=700).render(lens, CENTRE)
    ink = (0.85 - albedo(truth)) / 0.8
    side = 20.0 / 700 * np.array([lens.fx_px, lens.fy_px])
    left, top = np.array([lens.cx_px, lens.cy_px]) - np.array([6, 4]) * side
    # The black square in the upper left corner, with half of its white neighbours.
    window = ink[
        round(top - side[1] / 4) : round(top + 1.25 * side[1]),
        round(left - side[0] / 4) : round(left + 1.25 * side[0]),
    ]
    # A quarter of the black square diagonally below reaches in.
    assert window.sum() == pytest.approx(side.prod() * (1 + 1 / 16), rel=0.03)


@pytest.mark.slow
@pytest.mark.parametrize("marker_mm", [0.0, 15.0])
def test_corners_are_found_where_the_pose_puts_them(marker_mm: float) -> None:
    turned = {"x_mm": 20.0, "y_mm": -5.0, "tilt_x_deg": 12.0, "tilt_y_deg": -8.0, "roll_deg": 6.0}
    truth = see(marker_mm=marker_mm, **turned)
    printed = printed_board(11, 7, 20.0, marker_mm, "DICT_5X5_100")
    picture = albedo(truth).astype(np.float32)
    frames = PoseFrames("the twin", [], picture, np.zeros_like(picture))
    found, _ = refine_corners(frames, find_corners(picture, printed, "the twin"), printed)
    flat = corner_positions_mm(printed)
    x, y = (flat - flat.mean(0))[found.ids, :2].T
    a, b, c = np.radians([12.0, -8.0, 6.0])
    across, down = np.cos(c) * x - np.sin(c) * y, np.sin(c) * x + np.cos(c) * y
    points = np.stack(
        [
            20.0 + across * np.cos(b) - down * np.sin(a) * np.sin(b),
            -5.0 + down * np.cos(a),
            700.0 + across * np.sin(b) + down * np.sin(a) * np.cos(b),
        ]
    )
    expected = np.stack(project(CAMERA, *points), 1)
    if isinstance(printed, Charuco):
        assert len(found.ids) > 60
    else:
        # A checkerboard is the same from both ends.
        ends = np.linalg.norm(found.points_px[0] - expected[[0, -1]], axis=1)
        expected = expected if ends[0] < ends[1] else expected[::-1]
    assert np.abs(found.points_px - expected).max() < 0.05


def test_a_black_square_is_in_the_corner_and_the_margin_is_white() -> None:
    truth = see(margin_mm=15.0, depth_mm=750)
    rows, columns = np.nonzero(truth.material == INK)
    first = truth.material[rows.min() + 3, columns.min() + 3]
    assert first == INK
    assert truth.material[rows.min() - 3, columns.min() + 3] == PAPER


def test_impossible_boards_are_refused() -> None:
    with pytest.raises(PlanError, match="DICT_4X4_50 has 50"):
        make_scene("board", columns=20, rows=11, square_mm=10, marker_mm=8, dictionary="DICT_4X4_50")
    with pytest.raises(PlanError, match="no markers 'DICT_9X9_50'"):
        make_scene("board", marker_mm=8, dictionary="DICT_9X9_50")
    with pytest.raises(PlanError, match="tilt_y_deg"):
        make_scene("board", tilt_y_deg=80)


@pytest.mark.parametrize("name", ["nope", "DICT_NOPE"])
def test_markers_that_nobody_has_are_told(name: str) -> None:
    with pytest.raises(PlanError, match=f"{name.upper()}.* DICT_5X5_100"):
        make_scene("board", marker_mm=15.0, dictionary=name)
