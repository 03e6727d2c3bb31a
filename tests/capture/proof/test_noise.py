"""What counts are worth: by the sensor, or by what pairs of a code show where that is more."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.capture.proof.code.code_pairs import CodePairs, Pair
from dsl_core.capture.proof.noise import Noise, noise_excess
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


def test_a_greater_variance_counts_for_pictures_that_are_known_too() -> None:
    noise = Noise(SENSOR)
    taken = RASTER.take(np.full((96, 128), 500, np.uint16))
    stated = noise.variance(taken).copy()
    noise.take_excess(9.0)
    assert noise.variance(taken) == pytest.approx(9 * stated)


def differences(deviation: float, seed: int = 1) -> np.ndarray[tuple[int], np.dtype[np.float32]]:
    noise = np.random.default_rng(seed).standard_normal(128 * 96)
    return np.asarray(deviation * noise, np.float32)


def test_deviations_over_those_stated_are_measured() -> None:
    stated = np.full(128 * 96, 4.0, np.float32)
    assert noise_excess(differences(6.0), stated, RASTER) == pytest.approx(9.0, rel=0.2)
    assert noise_excess(differences(2.8), stated, RASTER) == 1.0, "what is stated holds within half"
    assert noise_excess(differences(100.0), stated, RASTER) == 64.0, "no camera is as much worse"
    assert noise_excess(differences(0.1), stated, RASTER) is None, "two exposures are never the same"


def test_light_that_changes_over_half_of_the_picture_is_no_noise() -> None:
    stated = np.full(128 * 96, 4.0, np.float32)
    columns = np.arange(128 * 96) % 128
    wrong = differences(2.0) + np.where(columns < 64, 400.0, -400.0) + 0.3 * columns
    assert noise_excess(wrong.astype(np.float32), stated, RASTER) == 1.0
    texture = np.where(columns < 64, 300.0 * np.sin(columns**2.0), 0.0)
    assert noise_excess((wrong + texture).astype(np.float32), stated, RASTER) == 1.0


def test_pixels_that_say_nothing_are_left_out() -> None:
    stated = np.full(128 * 96, 4.0, np.float32)
    apart = differences(6.0)
    apart[: apart.size // 2] = np.nan
    assert noise_excess(apart, stated, RASTER) == pytest.approx(9.0, rel=0.2)
    assert noise_excess(np.full_like(apart, np.nan), stated, RASTER) is None


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
    assert noise.excess == pytest.approx(36.0, rel=0.2)
    assert pairs.broken(new, pairs.sum()) is None


@pytest.mark.parametrize("times", [1.0, 3.0])
def test_a_wrong_picture_breaks_its_sum_and_is_not_taken_for_noise(times: float) -> None:
    noise = Noise(SENSOR)
    pairs = pairs_with(times, noise)
    wrong = noisy_pair(times, 2, wrong=True)
    pairs.learn_noise(wrong, RASTER)
    assert noise.excess == pytest.approx(times**2, rel=0.2)
    assert pairs.broken(wrong, pairs.sum()) is not None


def test_the_least_noise_of_all_pairs_counts() -> None:
    noise = Noise(SENSOR)
    pairs = pairs_with(3.0, noise)
    pairs.learn_noise(noisy_pair(5.0, 2), RASTER)
    first = noise.excess
    pairs.learn_noise(noisy_pair(3.0, 3), RASTER)
    least = noise.excess
    assert 9.0 * 0.8 < least < first
    pairs.learn_noise(noisy_pair(6.0, 4), RASTER)
    assert noise.excess == least
