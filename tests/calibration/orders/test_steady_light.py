"""A change of light while lines pass over a flat target is told from what the angle of view does."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from dsl_core.calibration.orders.steady_light import FEWEST_PARTS, PARTS, light_jump

FRAME_PX = 640


def target(
    pixels: int = 400, noise: float = 0.02, seed: int = 0
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Columns that pixels see, and the light of their zero orders through a filter at an angle."""
    rng = np.random.default_rng(seed)
    column = rng.uniform(20, 620, pixels)
    place = 2 * column / FRAME_PX - 1
    light = 5.0 * (1 + 0.05 * place - 0.15 * place**2) * (1 + noise * rng.standard_normal(pixels))
    return column, light


@pytest.mark.parametrize("seed", range(20))
def test_what_changes_smoothly_is_no_jump(seed: int) -> None:
    assert light_jump(*target(seed=seed), FRAME_PX) is None


@pytest.mark.parametrize(("share", "from_px"), [(-0.2, 520.0), (-0.2, 120.0), (0.1, 320.0)])
def test_a_jump_is_found_with_its_size_and_place(share: float, from_px: float) -> None:
    column, light = target()
    found = light_jump(column, light * np.where(column < from_px, 1.0, 1 + share), FRAME_PX)
    assert found is not None
    assert found.share == pytest.approx(share, abs=0.04)
    assert found.column_px == pytest.approx(from_px, abs=1.5 * FRAME_PX / PARTS)


#: Light of a tilted filter of 660 nm, where the red LED ends, from part to part of a frame.
EDGE = (
    2.564, 2.259, 1.820, 1.495, 1.276, 1.122, 1.011, 0.942, 0.881, 0.850,
    0.826, 0.818, 0.822, 0.843, 0.869, 0.917, 0.989, 1.080, 1.187, 1.329,
)  # fmt: skip


def steep(noise: float = 0.02, seed: int = 0) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Columns and light where an LED ends, so that the angle of view changes light threefold."""
    column, _ = target(2000)
    course = CubicSpline((np.arange(len(EDGE)) + 3.5) * FRAME_PX / PARTS, EDGE)
    column = column[(column > 90) & (column < 600)]
    noisy = 1 + noise * np.random.default_rng(seed).standard_normal(column.size)
    return column, course(column) * noisy


@pytest.mark.parametrize("seed", range(20))
def test_a_filter_at_the_edge_of_an_led_is_no_jump(seed: int) -> None:
    assert light_jump(*steep(seed=seed), FRAME_PX) is None


@pytest.mark.parametrize(("share", "from_px"), [(-0.2, 480.0), (-0.2, 200.0), (0.15, 320.0)])
def test_a_jump_is_found_where_an_led_ends(share: float, from_px: float) -> None:
    column, light = steep(0.01)
    found = light_jump(column, light * np.where(column < from_px, 1.0, 1 + share), FRAME_PX)
    assert found is not None
    assert found.share == pytest.approx(share, abs=0.04)


def test_light_that_goes_out_is_a_jump() -> None:
    column, light = target()
    found = light_jump(column, np.where(column < 320, light, 0.001 * light), FRAME_PX)
    assert found is not None
    assert found.share < -0.5


@pytest.mark.parametrize("factor", [0.0, -1.0])
def test_a_filter_that_lets_nothing_through_says_nothing(factor: float) -> None:
    column, light = target()
    light[column > 320] *= 2
    assert light_jump(column, factor * light, FRAME_PX) is None


def test_dirt_on_the_target_is_no_jump() -> None:
    column, light = target()
    light[np.abs(column - 300) < 4] *= 0.3
    assert light_jump(column, light, FRAME_PX) is None


def test_little_of_a_target_says_nothing() -> None:
    column, light = target()
    few = column < FRAME_PX * (FEWEST_PARTS - 2) / PARTS
    assert light_jump(column[few], np.where(column < 100, 1.0, 0.5)[few] * light[few], FRAME_PX) is None
