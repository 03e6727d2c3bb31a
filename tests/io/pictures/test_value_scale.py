"""White of pictures in fractions is where their values end, whatever a few sparks are."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.io.pictures.value_scale import ValueScale

RAMP = np.linspace(0, 0.8, 10000, dtype=np.float32).reshape(100, 100)


def test_values_that_end_at_one_value_are_limited_by_it() -> None:
    scale = ValueScale()
    scale.add(RAMP / 2)
    scale.add((RAMP * 2).clip(0, 1))
    assert scale.white == 1.0


def test_there_is_room_above_the_largest_value_of_what_no_sensor_limited() -> None:
    scale = ValueScale()
    scale.add(RAMP)
    scale.add(RAMP[::-1])
    assert scale.white == pytest.approx(0.84)


def test_a_few_sparks_do_not_take_the_bits_of_all_others() -> None:
    sparks = RAMP.copy()
    sparks[40, :9] = np.geomspace(30, 3000, 9)
    scale = ValueScale()
    scale.add(sparks)
    scale.add(RAMP)
    assert scale.white == pytest.approx(2.1 * 0.8, rel=1e-3)


@pytest.mark.parametrize("most", [0.0, np.inf, np.nan])
def test_white_is_unknown_where_no_value_says_it(most: float) -> None:
    scale = ValueScale()
    scale.add(np.full((5, 5), most, np.float32))
    assert scale.white is None


def _white(most: float, gain: float, kind: type, noise: float = 0.004) -> np.ndarray:
    """A wall that gets darker to its edges, seen by a camera whose values end at ``most``."""
    y, x = np.mgrid[-1:1:120j, -1:1:160j]
    light = gain * (0.8 - 0.3 * (x**2 + y**2))
    light += np.random.default_rng(1).normal(0, noise, light.shape)
    values = light.clip(0, 1) * most
    return np.asarray(values if kind is np.float32 else np.rint(values), kind)


@pytest.mark.parametrize(
    ("most", "kind"),
    [
        (255, np.uint8),
        (235, np.uint8),
        (255, np.uint16),
        (3900, np.uint16),
        (16383, np.uint16),
        (1, np.float32),
    ],
)
def test_a_sensor_that_ends_is_told_from_one_that_does_not(most: float, kind: type) -> None:
    for gain, limit in ((1.0, None), (1.5, most)):
        scale = ValueScale()
        scale.add(_white(most, gain, kind))
        scale.add(_white(most, gain / 2, kind))
        assert scale.limit == limit


@pytest.mark.parametrize("kind", [np.uint8, np.uint16, np.float32])
@pytest.mark.parametrize("blur", [1, 5])
def test_the_white_of_a_wall_that_a_program_drew_is_no_limit(kind: type, blur: int) -> None:
    most = 1.0 if kind is np.float32 else 200.0
    stripes = np.tile(np.repeat([1.0, 0.0], 16), (120, 5))
    waves = np.tile(0.5 + 0.5 * np.cos(np.arange(160) / 5), (120, 1))
    mixed = np.apply_along_axis(np.convolve, 1, stripes, np.full(blur, 1 / blur), "same")
    scale = ValueScale()
    for each in (mixed, waves, np.ones((120, 160)), np.zeros((120, 160))):
        scale.add((most * (0.1 + 0.6 * each)).astype(kind))
    assert scale.limit is None
