"""LEDs in turn stay within their bound."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.model.plan import CapturePlan
from dsl_core.simulation.effects.base import Limits
from dsl_core.simulation.effects.catalogue import EFFECTS, Choice
from dsl_core.simulation.led_cycle import largest_deviation, led_weights
from dsl_core.simulation.rendered_scene import EffectRequest
from tests.cases.effect_scenes import (
    HEIGHT,
    WIDTH,
    troubled_world,
    world_of,
)

BY_NAME = {effect.name: effect for effect in EFFECTS}


def test_leds_in_turn_change_a_frame_within_the_bound() -> None:
    worlds = [troubled_world("plane"), troubled_world("plane")]
    worlds[1].request = EffectRequest(Choice("steady", frozenset(BY_NAME) - {"led-cycle"}))
    worlds[0].request = EffectRequest(Choice.of("all"))
    exposure_ms, frames = CapturePlan().settings[0].exposure_ms, []
    for world in worlds:
        world.noise = False
        world.show(np.full((HEIGHT, WIDTH), 51, np.uint8))
        frames.append(world.expose(exposure_ms, 0).astype(float))
    change = np.abs(frames[0] - frames[1]).max()
    assert 1 < change <= BY_NAME["led-cycle"].bound(Limits(worlds[0].everything())).dn


@pytest.mark.parametrize("periods", [0.2, 0.9, 9.6, 20.34])
def test_the_largest_share_of_an_led_is_met_by_some_start(periods: float) -> None:
    shares = [led_weights(start, 100 * periods, 100.0) for start in np.linspace(0, 100, 601)]
    worst = np.abs(np.array(shares) - 1).max()
    assert worst == pytest.approx(largest_deviation(periods), rel=2e-2)
    assert worst <= largest_deviation(periods) + 1e-12


@pytest.mark.parametrize("exposure_ms", [5.0, 25.0])
def test_a_short_exposure_that_ends_within_a_cycle_is_decided_again(exposure_ms: float) -> None:
    frames = []
    for choice in ("auto", "all"):
        world = world_of("plane", request=EffectRequest(Choice.of(choice)), noise=False, led_cycle_ms=50 / 3)
        world.show(np.full((HEIGHT, WIDTH), 102, np.uint8))
        frames.append(world.expose(exposure_ms, 0).astype(float))
    assert np.abs(frames[0] - frames[1]).max() <= 2  # both are rounded
    judged = world.request.settings
    assert world.request.allowing(exposure_ms, 0.4, world.setup).settings == judged
