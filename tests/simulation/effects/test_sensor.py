"""Noise and saturation stay within their bounds."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.simulation.effects.base import Limits
from dsl_core.simulation.effects.catalogue import EFFECTS, Choice
from dsl_core.simulation.rendered_scene import EffectRequest
from tests.cases.effect_scenes import (
    HEIGHT,
    WIDTH,
    world_of,
)

BY_NAME = {effect.name: effect for effect in EFFECTS}


@pytest.mark.parametrize("name", ["shot-noise", "read-noise"])
def test_noise_lies_within_its_bound_and_shows(name: str) -> None:
    frames = []
    for names in (frozenset(BY_NAME), frozenset(BY_NAME) - {name}):
        world = world_of("plane", request=EffectRequest(Choice("some", names)))
        world.show(np.full((HEIGHT, WIDTH), 51, np.uint8))
        frames.append(world.expose(20.0, 0).astype(float))
    change = np.abs(frames[0] - frames[1]).max()
    # Both frames are rounded.
    assert 1 < change <= BY_NAME[name].bound(Limits(world.everything())).dn + 1


def test_without_saturation_numbers_go_on_to_the_end_of_the_container() -> None:
    world = world_of(
        "plane", request=EffectRequest(Choice("some", frozenset(BY_NAME) - {"saturation"})), noise=False
    )
    world.show(np.full((HEIGHT, WIDTH), 204, np.uint8))
    frame = world.expose(1000 / 6, 0)
    full = world.rig.sensor.full_scale_dn
    assert full < frame.max()
    bound = BY_NAME["saturation"].bound(Limits(world.everything()))
    assert frame.max() - full <= bound.dn
