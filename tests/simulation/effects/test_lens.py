"""What lenses do at every depth."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dsl_core.simulation.effects.base import Limits, make_view
from dsl_core.simulation.effects.lens import Glare
from tests.cases.effect_scenes import pictures, small_rig, world_of

IMAGES = pictures(np.random.default_rng(8))


def test_glare_spreads_a_share_of_the_mean_of_each_colour() -> None:
    path = world_of("plane").everything()
    flat = replace(path, extras=(Glare(share=0.1),))
    veiled, clear = (make_view(p).expected(IMAGES[0]) for p in (flat, replace(path, extras=())))
    gain = veiled - clear
    green = clear[::2, 1::2].sum() + clear[1::2, ::2].sum()
    assert gain[0, 0] == pytest.approx(0.1 * clear[::2, ::2].mean(), rel=1e-3)
    assert gain[0, 1] == pytest.approx(0.1 * green / (clear.size / 2), rel=1e-3)


def test_glare_of_a_camera_without_colours_is_bounded_by_the_pixels_there_are() -> None:
    rig = small_rig()
    mono = rig.model_copy(update={"sensor": rig.sensor.model_copy(update={"bayer": "MONO"})})
    path = world_of("plane", mono).everything()
    glare = Glare(share=0.005)
    veiled, clear = (make_view(replace(path, extras=extras)).expected(IMAGES[3]) for extras in ((glare,), ()))
    veil = float((veiled - clear).max())
    assert veil == pytest.approx(0.005 * clear.mean(), rel=1e-3)
    limits = Limits(path)
    assert veil * limits.demand.exposure_ms <= glare.bound(limits).dn < 0.5 * rig.sensor.full_scale_dn
