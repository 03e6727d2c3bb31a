"""What counts are worth: by the sensor, or by what pairs of a code show where that is more."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.capture.proof.code.code_pairs import CodePairs, Pair
from dsl_core.capture.proof.noise import Noise
from dsl_core.capture.proof.raster import Raster
from dsl_core.model.rig import Sensor

SENSOR = Sensor(black_level_dn=100.0, electrons_per_dn=10.0, read_noise_dn=2.0)
RASTER = Raster((128, 96))


def test_variance_of_counts_is_shot_noise_above_black_read_noise_and_rounding() -> None:
    noise = Noise(Sensor(black_level_dn=260.0, electrons_per_dn=4.0, read_noise_dn=3.0))
    counts = np.array([0, 260, 660], np.uint16)
    assert noise.variance(counts) == pytest.approx([9.1, 9.1, 109.1])
    counts[0] = 660
    assert noise.variance(counts)[0] == pytest.approx(109.1)
    taken = Raster((3, 1)).take(counts[None])
    assert noise.variance(taken) is noise.variance(taken), "what cannot change is remembered"


@pytest.mark.parametrize(
    ("bits", "electrons", "read_dn"), [(12, 10.0, 2.0), (8, 160.0, 0.5), (10, 40.0, 0.5), (16, 0.625, 32.0)]
)
def test_an_unknown_sensor_is_like_the_published_one_in_its_own_counts(
    bits: int, electrons: float, read_dn: float
) -> None:
    sensor = Noise.of(None, bits).sensor
    assert (sensor.bit_depth, sensor.black_level_dn) == (bits, 0.0)
    assert sensor.electrons_per_dn == pytest.approx(electrons)
    assert sensor.read_noise_dn == pytest.approx(read_dn)
    known = Sensor(bit_depth=10)
    assert Noise.of(known, 12).sensor is known


def test_another_sensor_counts_for_pictures_that_are_known_too() -> None:
    noise = Noise(SENSOR)
    taken = RASTER.take(np.full((96, 128), 500, np.uint16))
    stated = noise.variance(taken).copy()
    noise.take(9.0)
    assert noise.variance(taken) == pytest.approx(9 * stated, rel=0.01)


def excess_of(noise: Noise) -> float:
    return (noise.sensor.read_noise_dn / SENSOR.read_noise_dn) ** 2


def noisy_pair(times: float, seed: int, wrong: bool = False) -> Pair:
    """A pattern and its inverse on a surface, with so many times the noise of `SENSOR`."""
    random = np.random.default_rng(seed)
    lit = (np.arange(128)[None, :] * (seed + 1) // 128 % 2 == 0) & np.ones((96, 1), bool)
    pair = []
    for on in (lit, lit if wrong else ~lit):
        light = np.where(on, 150.0, 5.0)
        noise = times * np.sqrt(light / SENSOR.electrons_per_dn + SENSOR.read_noise_dn**2)
        values = np.rint(100.0 + light + noise * random.standard_normal(light.shape)).clip(0, 4095)
        pair.append(RASTER.take(values.astype(np.uint16)))
    return pair[0], pair[1]


def pairs_with(times: float, noise: Noise) -> CodePairs:
    pairs = CodePairs(noise)
    pairs.pairs[0] = noisy_pair(times, 1)
    return pairs


def test_pictures_of_a_camera_with_six_times_the_noise_break_no_sum() -> None:
    noise = Noise(SENSOR)
    pairs = pairs_with(6.0, noise)
    new = noisy_pair(6.0, 2)
    assert pairs.broken(new, pairs.sum()) is not None, "as stated, it is a wrong picture"
    pairs.learn_noise(new, RASTER)
    assert excess_of(noise) == pytest.approx(36.0, rel=0.2)
    assert pairs.broken(new, pairs.sum()) is None


@pytest.mark.parametrize("times", [1.0, 3.0])
def test_a_wrong_picture_breaks_its_sum_and_is_not_taken_for_noise(times: float) -> None:
    noise = Noise(SENSOR)
    pairs = pairs_with(times, noise)
    wrong = noisy_pair(times, 2, wrong=True)
    pairs.learn_noise(wrong, RASTER)
    assert excess_of(noise) == pytest.approx(times**2, rel=0.2)
    assert pairs.broken(wrong, pairs.sum()) is not None


def test_the_least_noise_of_all_pairs_counts() -> None:
    noise = Noise(SENSOR)
    pairs = pairs_with(3.0, noise)
    pairs.learn_noise(noisy_pair(5.0, 2), RASTER)
    first = excess_of(noise)
    pairs.learn_noise(noisy_pair(3.0, 3), RASTER)
    least = excess_of(noise)
    assert 9.0 * 0.8 < least < first
    pairs.learn_noise(noisy_pair(6.0, 4), RASTER)
    assert excess_of(noise) == least


def test_values_end_where_those_of_several_colours_pile_up_below_full_scale() -> None:
    channels = RASTER.channels("RGGB")
    lit = np.random.default_rng(0).normal(np.linspace(100, 6000, channels.size), 30)
    counts = lit.clip(0, 4094).astype(np.uint16)
    noise = Noise(SENSOR)
    one_colour = counts.copy()
    one_colour[channels != 1] = 500
    noise.find_end(one_colour, channels)
    assert noise.sensor.full_scale_dn == 4095, "it may be light without noise"
    noise.take(4.0)
    noise.find_end(counts, channels)
    assert noise.sensor.full_scale_dn == 4094
    assert excess_of(noise) == pytest.approx(4.0)
    noise.take(9.0)
    assert noise.sensor.full_scale_dn == 4094
    mono = Noise(SENSOR)
    mono.find_end(counts, RASTER.channels("MONO"))
    assert mono.sensor.full_scale_dn == 4094
