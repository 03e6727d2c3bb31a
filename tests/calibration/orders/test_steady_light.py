"""A change of light while lines pass over a flat target is told from what the angle of view does."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

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
