"""Defocus of both lenses, against a thin lens."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d

from dsl_core.simulation.effects.base import LightPath, make_view
from dsl_core.simulation.effects.catalogue import EXTRAS
from dsl_core.simulation.effects.depth_of_field import DepthOfField, gaussian_distance, layers
from tests.cases.effect_scenes import pictures, world_of

IMAGES = pictures(np.random.default_rng(8))


def only(path: LightPath, name: str) -> LightPath:
    """The plain renderer with one further effect."""
    return replace(path, extras=tuple(extra for extra in EXTRAS if extra.name == name))


def test_the_circle_of_confusion_is_that_of_a_thin_lens() -> None:
    world = world_of("steps step_mm=60 depth_mm=600")
    effect = DepthOfField(camera_aperture_mm=3.0)
    sigma = effect.blurs(world.everything()).camera_px
    depth, focus = world.truth.depth_mm, float(np.median(world.truth.depth_mm))
    # An image distance of nearly the focal length: diameter A f (z - f0) / (z f0).
    expected = 0.25 * 3.0 * world.rig.camera.fx_px * np.abs(depth - focus) / (depth * focus)
    assert sigma == pytest.approx(expected)
    assert not DepthOfField().blurs(world_of("plane").everything()).camera_px.any()


def test_layers_share_every_pixel() -> None:
    levels, weights = layers(np.linspace(0, 1.3, 60).reshape(6, 10))
    assert np.sum(weights, 0) == pytest.approx(np.ones((6, 10)), rel=1e-6)
    variance = np.sum([level**2 * weight for level, weight in zip(levels, weights, strict=True)], 0)
    assert variance.ravel() == pytest.approx(np.linspace(0, 1.3, 60) ** 2, abs=1e-6)


@pytest.mark.parametrize(("narrow", "wide"), [(0.6, 0.61), (0.6, 0.9), (0.6, 3.0)])
def test_the_distance_of_two_blurs_is_reached_and_not_passed(narrow: float, wide: float) -> None:
    per_px = 200
    x = np.arange(-20 * per_px, 20 * per_px + 1) / per_px
    narrow_bell, wide_bell = (
        np.exp(-0.5 * (x / s) ** 2) / (s * math.sqrt(2 * math.pi)) for s in (narrow, wide)
    )
    best = (np.maximum(narrow_bell - wide_bell, 0)).sum() / per_px
    assert gaussian_distance(narrow, wide) == pytest.approx(best, rel=1e-2)
    picture = np.random.default_rng(1).random(4000) > 0.5
    blurred = [gaussian_filter1d(picture.repeat(20).astype(float), 20 * s) for s in (narrow, wide)]
    assert np.abs(blurred[0] - blurred[1]).max() <= gaussian_distance(narrow, wide) * 1.01


def test_deep_steps_blur_away_from_the_focus_only() -> None:
    path = world_of("steps step_mm=80 depth_mm=560").everything()
    image = IMAGES[2]
    blurred, sharp = (
        make_view(p).expected(image) for p in (only(path, "depth-of-field"), replace(path, extras=()))
    )
    effect = DepthOfField()
    focused = effect.blurs(path).projector_px < 0.02
    change = np.abs(blurred - sharp)
    assert focused.sum() > 50
    assert change[~focused].mean() > 8 * change[focused].mean()
