"""What lenses do at every depth."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dsl_core.simulation.effects.base import make_view
from dsl_core.simulation.effects.lens import Glare
from tests.cases.effect_scenes import pictures, world_of

IMAGES = pictures(np.random.default_rng(8))


def test_glare_spreads_a_share_of_the_mean_of_each_colour() -> None:
    path = world_of("plane").everything()
    flat = replace(path, extras=(Glare(share=0.1),))
    veiled, clear = (make_view(p).expected(IMAGES[0]) for p in (flat, replace(path, extras=())))
    gain = veiled - clear
    green = clear[::2, 1::2].sum() + clear[1::2, ::2].sum()
    assert gain[0, 0] == pytest.approx(0.1 * clear[::2, ::2].mean(), rel=1e-3)
    assert gain[0, 1] == pytest.approx(0.1 * green / (clear.size / 2), rel=1e-3)
