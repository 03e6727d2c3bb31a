"""Where a target is wanted in the camera's picture, and whether it is there and keeps still."""

from __future__ import annotations

import numpy as np
import pytest
from dsl_app.calibrate.wizard.ghost import LEAST_SHARED, as_points, ghost, keeps_still, shared_part

from dsl_core.model.geometry import Lens
from dsl_core.model.placement import Placement

CAMERA = Lens(width_px=890, height_px=580, fx_px=1750, fy_px=1750, cx_px=440, cy_px=290)
BOARD: dict[str, float | str] = {"columns": 11, "rows": 7, "square_mm": 20.0, "depth_mm": 700.0}


def board(**options: float) -> Placement:
    return Placement(target="board", options={**BOARD, **options})


def test_the_outline_of_a_board_is_that_of_its_inner_corners() -> None:
    found = np.array(ghost(board(), CAMERA))
    assert found[:, 0].min() == pytest.approx(440 - 1750 * 100 / 700)
    assert found[:, 0].max() == pytest.approx(440 + 1750 * 100 / 700)
    assert np.ptp(found[:, 1]) == pytest.approx(1750 * 120 / 700)


def test_the_outline_follows_place_and_distance() -> None:
    near, far = (np.ptp(np.array(ghost(board(depth_mm=d), CAMERA))[:, 0]) for d in (600.0, 800.0))
    assert near / far == pytest.approx(8 / 6)
    moved = np.array(ghost(board(x_mm=70.0), CAMERA)) - np.array(ghost(board(), CAMERA))
    assert moved == pytest.approx(np.tile([175.0, 0.0], (4, 1)))


@pytest.mark.parametrize("target", ["as it is", "nothing", "spectralon"])
def test_targets_without_points_have_no_outline(target: str) -> None:
    assert ghost(Placement.model_validate({"target": target}), CAMERA) == ()


def test_a_chart_is_outlined_by_its_patches() -> None:
    found = np.array(ghost(Placement(target="color-checker", options={"depth_mm": 700.0}), CAMERA))
    assert np.ptp(found[:, 0]) == pytest.approx(1750 * 304 / 700)


def test_a_board_that_faces_the_camera_is_not_one_that_is_tilted() -> None:
    wanted = ghost(board(tilt_x_deg=40.0), CAMERA)
    assert shared_part(wanted, wanted) == pytest.approx(1.0, abs=1e-4)
    assert shared_part(wanted, ghost(board(tilt_x_deg=35.0), CAMERA)) > LEAST_SHARED
    assert shared_part(wanted, ghost(board(), CAMERA)) < LEAST_SHARED


def test_nothing_found_shares_nothing() -> None:
    assert shared_part(ghost(board(), CAMERA), ()) == 0
    assert shared_part((), ghost(board(), CAMERA)) == 0


def test_a_target_keeps_still_that_moves_by_less_than_a_pixel() -> None:
    points = as_points(np.array([[10.0, 10.0], [50.0, 12.0], [30.0, 40.0]]))
    assert keeps_still(points, as_points(np.array(points) + 0.6))
    assert not keeps_still(points, as_points(np.array(points) + np.array([0.0, 1.5])))
    assert keeps_still(points, points[::-1]), "a board without marks may be counted from its other end"
    assert not keeps_still(points, points[:2])
    assert not keeps_still((), ())
