"""Surfaces light each other by what they reflect, past what stands between them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from dsl_core.simulation.effects.base import LightPath, make_view
from dsl_core.simulation.effects.catalogue import EXTRAS
from dsl_core.simulation.effects.patches import Patches
from tests.cases.effect_scenes import HEIGHT, SIZE, WIDTH, world_of

WHITE = np.full((HEIGHT, WIDTH), 255, np.uint8)


def only(path: LightPath, name: str) -> LightPath:
    """The plain renderer with one further effect."""
    return replace(path, extras=tuple(extra for extra in EXTRAS if extra.name == name))


def test_the_floor_of_a_box_takes_the_colour_of_its_walls() -> None:
    path = world_of("box").everything()
    lit, alone = (
        make_view(p).planes(WHITE) for p in (only(path, "interreflection"), replace(path, extras=()))
    )
    gain = (lit - alone) / np.maximum(alone, 1e-3)
    assert (lit - alone).min() >= 0
    floor = (path.truth.material == 0) & (path.truth.normals[2] < -0.9) & path.truth.lit
    columns = np.where(floor, np.arange(SIZE[0]), -1)
    left = floor & (columns <= columns.max() * 0.35)
    right = floor & (columns >= columns.max() * 0.75)
    # Red on the left, green on the right.
    assert gain[0, left].mean() / gain[1, left].mean() > 1.1 * gain[0, right].mean() / gain[1, right].mean()
    assert 0.02 < gain[1, floor].mean() < 1


def test_a_plane_gets_no_light_from_itself() -> None:
    path = world_of("plane tilt_y_deg=30").everything()
    lit, alone = (
        make_view(p).expected(WHITE) for p in (only(path, "interreflection"), replace(path, extras=()))
    )
    assert np.array_equal(lit, alone)


def test_what_stands_between_two_walls_keeps_their_light_apart() -> None:
    world = world_of("relief")
    patches = Patches.of(world.rig, world.truth)
    factors = patches.form_factors()
    seen = patches.visible(factors, world.scene.surfaces)
    hidden = factors[~seen].sum() / factors.sum()
    assert np.array_equal(seen, seen.T)
    assert 0.001 < hidden < 0.9
