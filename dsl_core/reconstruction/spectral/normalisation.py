"""Measure how the settings of a bracket really compare, colour by colour.

Exposure and drive level say what the ratio of two settings should be. An exposure that is not a whole
number of projector frames catches the LEDs for unequal times, and gamma is known to a percent or so:
the measured ratio puts both right (Fig. 1 of the supplement of "Dispersed Structured Light",
Shin et al., CVPR 2024, normalises by one patch of a chart; here every pixel valid in both counts).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from dsl_core.errors import DecodeError
from dsl_core.model.rig import Sensor
from dsl_core.optics.sensor import bayer_channels, raw_variance
from dsl_core.reconstruction.hdr import BlackFrame

Floats = NDArray[np.float64]
Raw = NDArray[np.unsignedinteger]

_MIN_PIXELS = 100
_MIN_SIGMAS = 10.0
#: Huber's constant: 95 % efficient for Gaussian noise.
_HUBER = 1.345
_ITERATIONS = 12


@dataclass(frozen=True)
class ChannelRatios:
    """Measured over nominal gain of each setting and colour, relative to the weakest setting.

    Arrays of shape (settings, 3): ``ratio`` and its standard deviation ``std``, both without unit, and
    the number of ``pixels`` used (0 for the weakest setting, whose ratio is 1).
    """

    ratio: Floats
    std: Floats
    pixels: NDArray[np.int64]


def channel_ratios(
    shots: Sequence[Sequence[Raw]],
    gains_ms: Sequence[float] | Floats,
    blacks: Sequence[BlackFrame],
    sensor: Sensor,
) -> ChannelRatios:
    """Estimate from shots of the same patterns, ``shots[k][i]`` = pattern k at setting i.

    Settings are compared with their neighbours in gain and the ratios multiplied up, since the two ends of
    a long bracket share no valid pixels. Raises `DecodeError` where neighbours share too few.
    """
    order = np.argsort(gains_ms)
    ratio, variance = np.ones((len(blacks), 3)), np.zeros((len(blacks), 3))
    pixels = np.zeros((len(blacks), 3), np.int64)
    for weak, strong in pairwise(order):
        frames = [_signals(shots, i, float(gains_ms[i]), blacks[i], sensor) for i in (weak, strong)]
        for colour in range(3):
            x, y = (frame[colour] for frame in frames)
            step, std, count = _ratio(x, y, f"settings {weak} and {strong}, {'RGB'[colour]}")
            ratio[strong, colour] = ratio[weak, colour] * step
            variance[strong, colour] = variance[weak, colour] + (std / step) ** 2
            pixels[strong, colour] = count
    return ChannelRatios(ratio, ratio * np.sqrt(variance), pixels)


@dataclass(frozen=True)
class _Signals:
    """Black-subtracted values of one colour, DN; where they may be used; gain and noise floor."""

    dn: Floats
    usable: NDArray[np.bool_]
    headroom_dn: Floats
    floor: Floats
    gain_ms: float
    electrons_per_dn: float


def _signals(
    shots: Sequence[Sequence[Raw]], setting: int, gain_ms: float, black: BlackFrame, sensor: Sensor
) -> list[_Signals]:
    raw = np.stack([shot[setting] for shot in shots])
    channels = bayer_channels(sensor.bayer, *black.mean.shape)
    limit = 0.95 * sensor.full_scale_dn
    floor = raw_variance(sensor, black.mean - sensor.black_level_dn) + black.variance
    result = []
    for colour in range(3):
        sites = channels == colour
        values = raw[:, sites]
        result.append(
            _Signals(
                dn=(values - black.mean[sites].astype(np.float64)).ravel(),
                usable=(values < limit).ravel(),
                headroom_dn=np.tile(limit - black.mean[sites], len(shots)),
                floor=np.tile(floor[sites], len(shots)).astype(np.float64),
                gain_ms=gain_ms,
                electrons_per_dn=sensor.electrons_per_dn,
            )
        )
    return result


def _ratio(weak: _Signals, strong: _Signals, what: str) -> tuple[float, float, int]:
    """Robust ratio of sums of radiances, strong over weak, with its standard deviation."""
    radiance = (weak.dn + strong.dn) / (weak.gain_ms + strong.gain_ms)
    # Choosing by the expected value, not by the noisy one, keeps the choice from biasing the ratio.
    use = (
        weak.usable
        & strong.usable
        & (radiance * weak.gain_ms > _MIN_SIGMAS * np.sqrt(weak.floor))
        & (radiance * strong.gain_ms < strong.headroom_dn)
    )
    count = int(use.sum())
    if count < _MIN_PIXELS:
        raise DecodeError(
            f"Only {count} pixels are neither dark nor saturated in both of {what}; {_MIN_PIXELS} are needed"
            " to normalise them against each other. Choose settings closer together, or do without."
        )
    radiance = radiance[use]
    x, y = weak.dn[use] / weak.gain_ms, strong.dn[use] / strong.gain_ms
    var_x, var_y = (
        (s.floor[use] + radiance * s.gain_ms / s.electrons_per_dn) / s.gain_ms**2 for s in (weak, strong)
    )
    ratio = float(np.median(y / x))
    for _ in range(_ITERATIONS):
        variance = var_y + ratio**2 * var_x
        sigmas = np.abs(y - ratio * x) / np.sqrt(variance)
        weight = radiance / variance * np.minimum(1, _HUBER / np.maximum(sigmas, _HUBER))
        ratio = float((weight * y).sum() / (weight * x).sum())
    spread = np.sqrt(((weight * (y - ratio * x)) ** 2).sum())
    return ratio, float(spread / (weight * x).sum()), count
