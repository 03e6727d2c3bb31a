"""Bounds of effects hold in every pixel, and leaving out what a scene calls for shows."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from dsl_core.simulation.effects.base import LightPath, Limits, make_view
from dsl_core.simulation.effects.catalogue import EFFECTS, Choice
from dsl_core.simulation.effects.planner import EffectPlan, plan_effects
from dsl_core.simulation.effects.tolerance import Tolerance
from dsl_core.simulation.rendered_scene import EffectRequest
from tests.cases.effect_scenes import (
    CALLS_FOR,
    HEIGHT,
    WIDTH,
    frame_dn,
    frames_dn,
    largest_change,
    pictures,
    troubled_world,
    world_of,
)

#: These change how light becomes numbers, or only frames with time and noise; they have tests of their own.
LATER = {"led-cycle", "shot-noise", "read-noise", "saturation"}
BY_NAME = {effect.name: effect for effect in EFFECTS}
#: What single precision rounds of a full scale.
ROUNDING_DN = 1e-3
IMAGES = pictures(np.random.default_rng(3))


@pytest.mark.parametrize("scene", ["box", "sphere gloss=0.04"])
def test_nothing_is_brighter_than_the_ceiling(scene: str) -> None:
    box = troubled_world(scene).everything()
    limits = Limits(box)
    white = make_view(box).expected(np.full((HEIGHT, WIDTH), 255, np.uint8))
    assert 0.1 * limits.ceiling < float(white.max()) <= limits.ceiling


@cache
def everything_of(scene: str, troubled: bool) -> tuple[LightPath, EffectPlan, NDArray[np.float32]]:
    """A path with everything, its plan, and its frames."""
    path = (troubled_world if troubled else world_of)(scene).everything()
    return path, plan_effects(path), frames_dn(path, IMAGES, Limits(path).demand.exposure_ms)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "scene"), [item for item in CALLS_FOR.items() if item[0] not in LATER], ids=lambda text: text
)
def test_what_a_scene_calls_for_changes_it_by_more_than_the_tolerance_and_less_than_the_bound(
    name: str, scene: str
) -> None:
    path, plan, frames = everything_of(scene, name in ("vignetting", "defocus", "ambient"))
    assert name in plan.names
    without = frames_dn(BY_NAME[name].leave_out(path), IMAGES, Limits(path).demand.exposure_ms)
    change = float(np.abs(without - frames).max())
    assert plan.tolerance.value < change <= BY_NAME[name].bound(Limits(path)).dn + ROUNDING_DN


@pytest.mark.slow
@pytest.mark.parametrize("scene", ["plane tilt_y_deg=20", "leaves", "sphere gloss=1e-8", "face"])
def test_auto_differs_from_all_by_less_than_the_tolerance(scene: str) -> None:
    tolerance = Tolerance(2.0)
    world = world_of(scene, request=EffectRequest(Choice.of("auto"), tolerance))
    left_out = {decision.effect.name for decision in world.effect_plan().left_out}
    assert left_out > {"led-cycle", "vignetting", "defocus", "ambient"}
    assert largest_change(world.everything(), world.path, IMAGES) < tolerance.value


def test_frames_of_the_camera_are_those_compared_here() -> None:
    world = world_of("sphere gloss=0.04", request=EffectRequest(Choice.of("all")), noise=False)
    world.show(IMAGES[0])
    expected = frame_dn(world.path, world.renderer, IMAGES[0], 100.0)
    assert np.array_equal(world.expose(100.0, 0), np.rint(expected).astype(np.uint16))
