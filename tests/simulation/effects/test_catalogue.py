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
        # White lines are rendered once for all settings, and then made as bright: to the precision of that.
        for colour, start in ((0, 0), (2, 1)):
            own = mosaic[start::2, start::2]
            np.testing.assert_allclose(planes[colour, start::2, start::2], own, rtol=2e-6)


def test_all_effects_left_out_but_the_usual_ones_give_the_plain_picture() -> None:
    world = world_of("box")
    path = with_effects(world.everything(), Choice.of("usual").names or ())
    assert np.array_equal(make_view(path).expected(IMAGES[0]), world.renderer.expected(IMAGES[0]))
