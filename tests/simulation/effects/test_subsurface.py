"""Light that wanders in translucent materials is conserved and goes as far as it should."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dsl_core.simulation.effects.base import LightPath
from dsl_core.simulation.effects.catalogue import EXTRAS
from dsl_core.simulation.effects.subsurface import profile, stays, within
from tests.cases.effect_scenes import HEIGHT, SIZE, WIDTH, world_of

WHITE = np.full((HEIGHT, WIDTH), 255, np.uint8)


def only(path: LightPath, name: str) -> LightPath:
    """The plain renderer with one further effect."""
    return replace(path, extras=tuple(extra for extra in EXTRAS if extra.name == name))


@pytest.mark.parametrize("spread_px", [0.3, 1.0, 4.0])
def test_a_profile_keeps_all_light_and_spreads_it_as_far_as_it_should(spread_px: float) -> None:
    weights = profile(spread_px)
    assert weights.sum() == pytest.approx(1.0)
    assert weights.min() >= 0
    middle = len(weights) // 2
    assert weights[middle, middle] == pytest.approx(stays(spread_px))
    x = np.arange(len(weights)) - middle
    inside = weights[np.hypot(x, x[:, None]) <= 3 * spread_px + 2].sum()
    assert inside == pytest.approx(within(3 * spread_px + 2, spread_px), abs=0.04)


def test_even_light_on_wax_stays_as_it_is() -> None:
    path = only(world_of("wax").everything(), "subsurface")
    stage, wax = path.extras[0].step(path), path.truth.material == 0
    even = np.broadcast_to(np.where(wax, 100.0, 7.0).astype(np.float32), (3, *wax.shape))
    assert stage.apply(even, WHITE) == pytest.approx(even, rel=1e-5)


def test_light_on_wax_leaves_beside_a_line_and_elsewhere_stays() -> None:
    path = only(world_of("wax").everything(), "subsurface")
    stage, wax = path.extras[0].step(path), path.truth.material == 0
    columns = np.flatnonzero(wax[SIZE[1] // 2])
    line = np.zeros((3, *wax.shape), np.float32)
    lit = columns[len(columns) // 4]
    line[:, :, lit] = 100.0
    spread = stage.apply(line, WHITE)
    row = spread[0, SIZE[1] // 2]
    assert 10 < row[lit] < 99
    assert 0.1 < row[lit + 1] < row[lit]
    assert not spread[:, ~wax & (line[0] == 0)].any()
