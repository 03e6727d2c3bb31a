"""Highlights are where a mirror would show the projector."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dsl_core.simulation.effects.base import LightPath, make_view
from dsl_core.simulation.effects.catalogue import EXTRAS
from dsl_core.simulation.effects.specular import highlight
from dsl_core.simulation.scenes.truth import Finish
from tests.cases.effect_scenes import HEIGHT, WIDTH, world_of

WHITE = np.full((HEIGHT, WIDTH), 255, np.uint8)


def only(path: LightPath, name: str) -> LightPath:
    """The plain renderer with one further effect."""
    return replace(path, extras=tuple(extra for extra in EXTRAS if extra.name == name))


def test_the_highlight_is_where_the_mirror_would_be_and_dims_with_roughness() -> None:
    light = np.array([100.0, 0.0, 0.0])
    points = np.stack([np.linspace(0, 100, 101), np.zeros(101), np.full(101, 700.0)])
    normals = np.broadcast_to([[0.0], [0.0], [-1.0]], points.shape)
    smooth, rough = (highlight(Finish(gloss=0.04, roughness=r), points, normals, light) for r in (0.2, 0.5))
    assert smooth.argmax() == 50
    # At the mirror's place: D = 1 / (pi alpha^2), F nearly the gloss, and masking nearly one.
    assert smooth.max() == pytest.approx(0.04 / (4 * 0.2**4), rel=0.02)
    assert rough.max() == pytest.approx(0.04 / (4 * 0.5**4), rel=0.02)


def test_a_glossy_ball_is_brighter_at_its_highlight_only() -> None:
    path = world_of("sphere gloss=0.04").everything()
    shiny = make_view(only(path, "specular")).expected(WHITE)
    matte = make_view(replace(path, extras=())).expected(WHITE)
    gain = shiny - matte
    ball = path.truth.material == 0
    assert not gain[~ball].any()
    assert gain.max() > 0.2 * matte[ball].max()
    assert np.median(gain[ball]) < 0.1 * gain.max()
