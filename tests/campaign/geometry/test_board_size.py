"""Boards that a rig places itself suit its view: near, far, on its side; boards that fit stay as they are."""

from __future__ import annotations

from pathlib import Path

import pytest

from dsl_core.campaign.common.recipe import Bench
from dsl_core.campaign.geometry.board_poses import default_poses
from dsl_core.campaign.geometry.board_size import LEAST_SHARE, fitting_board
from dsl_core.campaign.geometry.recipe import BOARD_NAME, USUAL_BOARD, GeometryRecipe
from dsl_core.model.board import Charuco, Checkerboard
from dsl_core.model.rig import Rig
from dsl_core.simulation.published_rig import published_rig
from dsl_core.simulation.sim_devices import open_twin


def seen_at(scale: float) -> Rig:
    """The published rig with every length, but that of boards, so many times as long."""
    rig = published_rig()
    x, y, z = rig.pose.translation_mm
    pose = rig.pose.model_copy(update={"translation_mm": (scale * x, scale * y, scale * z)})
    low, high = rig.depth_range_mm
    return rig.model_copy(update={"pose": pose, "depth_range_mm": (scale * low, scale * high)})


@pytest.mark.slow
@pytest.mark.parametrize(("scale", "square_mm"), [(0.5, 15.0), (1.0, 20.0), (2.0, 60.0)])
def test_squares_follow_the_view_of_a_rig(scale: float, square_mm: float) -> None:
    found = fitting_board(USUAL_BOARD, seen_at(scale), 4)
    assert found == USUAL_BOARD.model_copy(update={"square_mm": square_mm})
    assert len(default_poses(found, seen_at(scale), 4)) == 4


def test_markers_keep_their_share_of_a_square() -> None:
    found = fitting_board(Charuco(columns=9, rows=6, square_mm=28, marker_mm=21), seen_at(0.5), 4)
    assert found.square_mm < 28
    assert isinstance(found, Charuco)
    assert found.marker_mm / found.square_mm == pytest.approx(0.75)


@pytest.mark.slow
def test_a_board_that_no_squares_make_fit_stays_and_is_refused_by_name() -> None:
    rig = published_rig()
    aside = rig.pose.model_copy(update={"translation_mm": (900.0, 0.0, 0.0)})
    assert fitting_board(USUAL_BOARD, rig.model_copy(update={"pose": aside}), 3) == USUAL_BOARD
    assert LEAST_SHARE > 0.08


def bench_of(scale: float, folder: Path) -> Bench:
    return Bench(open_twin({"size": "60x40"}), folder, seen_at(scale))


@pytest.mark.slow
def test_a_rig_that_places_boards_gets_squares_of_its_own_and_keeps_them(tmp_path: Path) -> None:
    recipe, bench = GeometryRecipe(), bench_of(0.5, tmp_path)
    step = recipe.steps(bench)[0]
    assert step.placement.options["square_mm"] == 10.0
    recipe._plan(bench, step)
    (bench.step_folder(step) / "scan.dsl").mkdir()
    assert recipe._board(bench_of(1.0, tmp_path)).square_mm == 10.0
    # What was captured before boards had a note is of the usual one.
    (bench.step_folder(step) / BOARD_NAME).unlink()
    assert recipe._board(bench) == USUAL_BOARD


def test_a_board_that_somebody_chose_or_holds_is_not_exchanged(tmp_path: Path) -> None:
    chosen = Checkerboard(columns=9, rows=6, square_mm=80.0)
    assert GeometryRecipe(board=chosen)._board(bench_of(1.0, tmp_path)) == chosen
    by_hand = bench_of(0.5, tmp_path)
    by_hand.devices.place = None
    assert GeometryRecipe()._board(by_hand) == USUAL_BOARD
