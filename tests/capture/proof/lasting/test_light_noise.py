"""Noise of light tells a camera's gain: pictures drawn electron by electron, with gains of their own."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest
from numpy.typing import NDArray

from dsl_core.capture.proof.lasting.light_noise import has_no_noise, light_noise
from dsl_core.capture.proof.noise import Noise
from dsl_core.capture.proof.raster import Raster
from dsl_core.model.rig import Sensor

SIZE_PX = 112, 72
SENSOR = Sensor(electrons_per_dn=10.0, black_level_dn=200.0, read_noise_dn=1.0)
RASTER = Raster(SIZE_PX)


def electrons(lamp: float) -> NDArray[np.float64]:
    """Light of white on surfaces of two colours side by side, brighter to the right."""
    light = np.linspace(4000.0, 9000.0, SIZE_PX[0]) * np.ones((SIZE_PX[1], 1))
    light[20:50, 30:60] *= 0.5
    return lamp * light


def pairs_of(
    gain: float = 1.0, lamps: tuple[float, ...] = (1.0,) * 4, more: tuple[float, ...] = (0.0,) * 4
) -> Mapping[int, tuple[NDArray[np.uint16], NDArray[np.uint16]]]:
    """Four pairs by a camera of that gain over the calibrated one, with the light of ``lamps``.

    ``more`` is further noise of each pair, DN.
    """
    rng = np.random.default_rng(3)
    found = {}
    for number, (lamp, extra) in enumerate(zip(lamps, more, strict=True)):
        is_lit = np.arange(SIZE_PX[0]) * 2 ** (number + 1) // SIZE_PX[0] % 2 == 1
        pair = []
        for lit in (is_lit, ~is_lit):
            counted = rng.poisson(electrons(lamp) * np.where(lit, 1.0, 0.01))
            dn = 200 + gain * counted / 10.0 + np.hypot(1.0, extra) * rng.standard_normal(counted.shape)
            pair.append(RASTER.take(np.rint(dn).clip(0, 4095).astype(np.uint16)))
        found[number] = (pair[0], pair[1])
    return found


@pytest.mark.parametrize("gain", [0.5, 2.0])
def test_another_gain_than_calibrated_is_told_with_its_factor(gain: float) -> None:
    found = light_noise(pairs_of(gain), Noise(SENSOR), RASTER)
    assert found is not None
    assert found.times == pytest.approx(gain, rel=0.15)
    assert f"gain is about {'+' if gain > 1 else '-'}" in found.sentence


@pytest.mark.parametrize("gain", [0.9, 1.0, 1.15])
def test_a_gain_that_a_self_test_leaves_open_is_none(gain: float) -> None:
    assert light_noise(pairs_of(gain), Noise(SENSOR), RASTER) is None


def test_a_lamp_that_flickers_and_pictures_that_tremble_are_no_gain() -> None:
    assert light_noise(pairs_of(lamps=(1.0, 1.05, 0.95, 1.02)), Noise(SENSOR), RASTER) is None
    # Finer stripes have more edges.
    assert light_noise(pairs_of(more=(20.0, 30.0, 45.0, 60.0)), Noise(SENSOR), RASTER) is None


def test_without_noise_or_light_nothing_is_told() -> None:
    one = pairs_of()[0]
    still = dict.fromkeys(range(4), one)
    assert light_noise(still, Noise(SENSOR), RASTER) is None
    assert has_no_noise(still, Noise(SENSOR), RASTER)
    assert not has_no_noise(pairs_of(0.5), Noise(SENSOR), RASTER)
    assert light_noise(pairs_of(lamps=(0.002,) * 4), Noise(SENSOR), RASTER) is None
