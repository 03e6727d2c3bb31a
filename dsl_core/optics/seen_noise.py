"""How noisy a camera is, as pictures show, whatever its calibration or data sheet says.

Light adds up: every pattern of a code and its inverse together are white and black together, so that sums of
two pairs differ by noise alone, unless a picture is wrong. That is told apart by place: noise is in every
part of a picture, and independent from pixel to pixel, while a wrong picture differs smoothly where the
surface is smooth.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.rig import Sensor
from dsl_core.optics.sensor import raw_variance
from dsl_core.solve.robust import robust_std

Counts = NDArray[np.uint16]
Pair = tuple[Counts, Counts]
#: A pixel counts if its pictures differ by so many standard deviations.
LIT_SIGMAS = 6.0
#: Parts of the picture that are compared, down and across, and the share of them that have less noise.
PARTS, CALM = 4, 0.25
#: Pixels that a part has to have.
FEWEST = 24
#: Deviations over those stated from which on these are not believed, and up to which the others are.
STATED_HOLDS, MOST = 1.5, 8.0
#: Deviations over those stated that no two exposures have.
NO_NOISE = 0.2
#: Pairs that are compared, each with the next: of a wrong picture, others show that it is not noise.
PAIRS = 3
#: Share of the pixels of black that may be darker than the black level.
DARKER = 0.05


def noise_excess(
    one: Pair, other: Pair, variance: Callable[[Counts], NDArray[np.floating]], full_scale_dn: int
) -> float | None:
    """Variance of counts over the one stated, 1 where that holds; None where nothing can be told.

    Two pairs of pictures of a raw mosaic, (rows, columns), each of a pattern and its inverse, of columns that
    alternate in colour or are all of one; ``variance`` is what is stated of counts, DN^2. Pixels are compared
    with the next but one in their row, so that what changes slowly over the picture does not count.
    """
    every = (*one, *other)
    stated = np.sum([variance(each) for each in every], axis=0)
    low, high = np.minimum.reduce(every), np.maximum.reduce(every)
    sound = (high.astype(np.float32) - low > LIT_SIGMAS * np.sqrt(stated)) & (high < full_scale_dn)
    sums = (np.add(*pair, dtype=np.float32) for pair in (one, other))
    apart = np.where(sound, np.subtract(*sums), np.float32(np.nan))
    steps = np.abs(apart[:, 2:] - apart[:, :-2]) / np.sqrt(stated[:, 2:] + stated[:, :-2])
    parts = [
        float(robust_std(known))
        for rows in np.array_split(steps, PARTS, axis=0)
        for part in np.array_split(rows, PARTS, axis=1)
        if (known := part[np.isfinite(part)]).size >= FEWEST
    ]
    if not parts:
        return None
    deviation = min(float(np.quantile(parts, CALM)), MOST)
    if deviation < NO_NOISE:
        return None  # a camera that sent pictures again
    return deviation**2 if deviation > STATED_HOLDS else 1.0


def noisier(sensor: Sensor, excess: float) -> Sensor:
    """The sensor with ``excess`` times the variance, but for that of rounding."""
    update = {
        "electrons_per_dn": sensor.electrons_per_dn / excess,
        "read_noise_dn": sensor.read_noise_dn * float(np.sqrt(excess)),
    }
    return sensor.model_copy(update=update) if excess != 1 else sensor


def usual_sensor(bit_depth: int) -> Sensor:
    """A sensor like the published camera's with this bit depth, whose black level nobody knows."""
    share = 2.0 ** (bit_depth - 12)
    return Sensor(
        bit_depth=bit_depth,
        black_level_dn=0.0,
        electrons_per_dn=Sensor().electrons_per_dn / share,
        read_noise_dn=max(2.0 * share, 0.5),
    )


def least_excess(pairs: Sequence[Pair], sensor: Sensor) -> float:
    """The least `noise_excess` of pairs over what a sensor states, each compared with the next; 1 of one."""

    def variance(counts: Counts) -> NDArray[np.floating]:
        return raw_variance(sensor, counts.astype(np.float32) - np.float32(sensor.black_level_dn))

    found = [noise_excess(one, other, variance, sensor.full_scale_dn) for one, other in pairwise(pairs)]
    return min((each for each in found if each is not None), default=1.0)


def seen_sensor(stated: Sensor, black: Counts, pairs: Sequence[Pair]) -> Sensor:
    """A sensor with the black level that a black picture shows, and the noise of ``pairs`` of a code.

    All are raw mosaics (rows, columns). Light of the room counts as black level where it is everywhere; its
    noise is in that of pairs.
    """
    sensor = stated.model_copy(update={"black_level_dn": float(np.quantile(black, DARKER))})
    return noisier(sensor, least_excess(pairs, sensor))
