"""Noise and saturation stay within their bounds."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.model.plan import Setting
from dsl_core.simulation.effects.base import Limits
from dsl_core.simulation.effects.catalogue import EFFECTS, Choice
from dsl_core.simulation.effects.sensor import TAIL_SIGMAS
from dsl_core.simulation.rendered_scene import EffectRequest
from tests.cases.effect_scenes import (
    HEIGHT,
    WIDTH,
    small_rig,
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


@pytest.mark.parametrize("noise", [False, True])
def test_saturation_is_rendered_where_the_brightest_led_or_noise_reaches_full_scale(noise: bool) -> None:
    rig = small_rig()
    most = Limits(world_of("plane", rig).everything(), (Setting(exposure_ms=25.0, level=1.0),)).most_dn
    room = rig.sensor.full_scale_dn - rig.sensor.black_level_dn
    dim = rig.model_copy(update={"white_scale": rig.white_scale * (0.99 if noise else 0.8) * room / most})
    for cycle_ms, is_on in ((None, noise), (50 / 3, True)):
        path = world_of("plane", dim, led_cycle_ms=cycle_ms).everything()
        bound = BY_NAME["saturation"].bound(Limits(path, (Setting(exposure_ms=25.0, level=1.0),)))
        assert (bound.dn > 0) == is_on


def test_light_of_the_room_has_shot_noise() -> None:
    path = world_of("plane", ambient_dn_per_ms=8.0).everything()
    bound = BY_NAME["shot-noise"].bound(Limits(path, (Setting(exposure_ms=100.0, level=0.004),)))
    assert bound.dn >= TAIL_SIGMAS * (800 / path.rig.sensor.electrons_per_dn) ** 0.5
