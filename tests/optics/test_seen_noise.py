"""Noise is told from pairs of pictures of one light, and from pictures that are wrong."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from dsl_core.model.rig import Sensor
from dsl_core.optics.seen_noise import Pair, noise_excess, noisier

SHAPE = (96, 128)
LIGHT = 400.0 * np.ones(SHAPE)
COLUMNS = np.arange(128) * np.ones((96, 1))


def pair_of(
    deviation: float, seed: int, add: NDArray[np.float64] | float = 0.0, light: NDArray[np.float64] = LIGHT
) -> Pair:
    random = np.random.default_rng(seed)
    bright, dark = (each + deviation * random.standard_normal(SHAPE) for each in (light + add, 0 * light))
    return np.rint(100 + bright).astype(np.uint16), np.rint(100 + dark).astype(np.uint16)


def excess(one: Pair, other: Pair) -> float | None:
    """With a stated deviation of 3 DN."""
    return noise_excess(one, other, lambda counts: np.full(counts.shape, 9.0), 4095)


@pytest.mark.parametrize(("deviation", "found"), [(9.0, 9.0), (18.0, 36.0)])
def test_variance_over_that_stated_is_measured(deviation: float, found: float) -> None:
    assert excess(pair_of(deviation, 1), pair_of(deviation, 2)) == pytest.approx(found, rel=0.2)


def test_what_is_stated_holds_within_half_and_no_camera_is_far_worse() -> None:
    assert excess(pair_of(4.0, 1), pair_of(4.0, 2)) == 1.0
    assert excess(pair_of(33.0, 1), pair_of(33.0, 2)) == 64.0


def test_two_exposures_are_never_the_same() -> None:
    assert excess(pair_of(9.0, 1), pair_of(9.0, 1)) is None


def test_another_pattern_or_light_is_no_noise_on_a_surface_that_has_smooth_parts() -> None:
    wrong = np.where(COLUMNS < 64, 300.0, -300.0) + COLUMNS
    textured = wrong + np.where(COLUMNS < 64, 90.0 * np.sin(COLUMNS**2), 0.0)
    for each in (wrong, textured):
        assert excess(pair_of(3.0, 1), pair_of(3.0, 2, each)) == 1.0


def test_pixels_without_light_or_beyond_full_scale_say_nothing() -> None:
    dark, bright = LIGHT.copy(), LIGHT.copy()
    dark[:, :100] = 0
    bright[:, :100] = 4000
    for light in (dark, bright):
        one, other = (pair_of(9.0, seed, light=light) for seed in (1, 2))
        one[0][:, :100] = np.minimum(one[0][:, :100], 4095)
        assert excess(one, other) == pytest.approx(9.0, rel=0.3)
    assert excess(pair_of(9.0, 1, light=0 * LIGHT), pair_of(9.0, 2, light=0 * LIGHT)) is None


def test_a_noisier_sensor_has_so_many_times_the_variance() -> None:
    sensor = Sensor(electrons_per_dn=8.0, read_noise_dn=1.5)
    found = noisier(sensor, 4.0)
    assert (found.electrons_per_dn, found.read_noise_dn) == (2.0, 3.0)
    assert noisier(sensor, 1.0) is sensor
