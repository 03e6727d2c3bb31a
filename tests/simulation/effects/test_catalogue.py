"""Effects together give the picture that their choice says."""

from __future__ import annotations

import numpy as np

from dsl_core.simulation.effects.base import make_view
from dsl_core.simulation.effects.catalogue import Choice, with_effects
from dsl_core.simulation.rendering.renderer import Renderer
from tests.cases.effect_scenes import pictures, world_of

IMAGES = pictures(np.random.default_rng(8))


def test_the_usual_twin_is_the_plain_renderer() -> None:
    world = world_of("steps")
    plain = Renderer(world.rig, world.truth)
    assert isinstance(world.renderer, Renderer)
    for image in IMAGES:
        assert np.array_equal(world.renderer.expected(image), plain.expected(image))


def test_three_colours_hold_the_mosaic() -> None:
    world = world_of("sphere")
    plain = Renderer(world.rig, world.truth)
    for image in IMAGES:
        planes, mosaic = plain.planes(image), plain.expected(image)
        assert np.array_equal(planes[0, ::2, ::2], mosaic[::2, ::2])
        assert np.array_equal(planes[2, 1::2, 1::2], mosaic[1::2, 1::2])


def test_all_effects_left_out_but_the_usual_ones_give_the_plain_picture() -> None:
    world = world_of("box")
    path = with_effects(world.everything(), Choice.of("usual").names or ())
    assert np.array_equal(make_view(path).expected(IMAGES[0]), world.renderer.expected(IMAGES[0]))
