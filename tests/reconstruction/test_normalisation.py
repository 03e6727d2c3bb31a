"""Ratios between settings are recovered within their own uncertainty, outliers or not."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from dsl_core.errors import DecodeError
from dsl_core.model.rig import Sensor
from dsl_core.optics.sensor import bayer_channels, digitise
from dsl_core.reconstruction.hdr import BlackFrame, black_frame
from dsl_core.reconstruction.spectral.normalisation import channel_ratios

SENSOR = Sensor(bayer="GBRG", read_noise_dn=1.0)
SHAPE = (80, 60)


def bracket(
    gains: list[float], truth: NDArray[np.float64], seed: int, outliers: bool = False
) -> tuple[list[list[NDArray[np.uint16]]], list[BlackFrame]]:
    rng = np.random.default_rng(seed)
    radiance = rng.exponential(2.0, SHAPE)
    channels = bayer_channels(SENSOR.bayer, *SHAPE)
    signals = [(g * t[channels] * radiance).astype(np.float32) for g, t in zip(gains, truth, strict=True)]
    raws = [digitise(SENSOR, s, rng) for s in signals]
    if outliers:
        raws[0][rng.random(SHAPE) < 0.03] += np.uint16(300)
    blacks = [
        black_frame([digitise(SENSOR, np.zeros(SHAPE, np.float32), rng) for _ in range(4)], SENSOR)
        for _ in gains
    ]
    return [raws], blacks


TRUTH = np.array([[1.0, 1.0, 1.0], [1.1, 0.95, 1.02], [1.2, 0.9, 1.01]])


@pytest.mark.parametrize("outliers", [False, True])
def test_ratios_within_their_uncertainty(outliers: bool) -> None:
    gains = [20.0, 200.0, 1500.0]
    sigmas = []
    for seed in range(8):
        shots, blacks = bracket(gains, TRUTH, seed, outliers)
        found = channel_ratios(shots, gains, blacks, SENSOR)
        np.testing.assert_array_equal(found.ratio[0], 1)
        np.testing.assert_allclose(found.ratio, TRUTH, rtol=0.02)
        assert (found.std[1:] < 0.005).all()
        sigmas.append(((found.ratio - TRUTH)[1:] / found.std[1:]).ravel())
    if not outliers:
        assert 0.6 < np.sqrt(np.mean(np.square(sigmas))) < 1.5


def test_order_of_settings_does_not_matter() -> None:
    shots, blacks = bracket([200.0, 20.0], TRUTH[[1, 0]], 1)
    found = channel_ratios(shots, [200.0, 20.0], blacks, SENSOR)
    np.testing.assert_allclose(found.ratio, TRUTH[[1, 0]], atol=0.01)
    assert (found.pixels[0] > 100).all()


def test_settings_without_common_pixels_say_so() -> None:
    shots, blacks = bracket([0.1, 1e5], TRUTH[:2], 1)
    with pytest.raises(DecodeError, match="closer together"):
        channel_ratios(shots, [0.1, 1e5], blacks, SENSOR)
