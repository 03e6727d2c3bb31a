"""How noisy a camera is, as pictures show, whatever its calibration or data sheet says.

Light adds up: every pattern of a code and its inverse together are white and black together, so that sums of
two pairs differ by noise alone, unless a picture is wrong. That is told apart by place: noise is in every
part of a picture, and independent from pixel to pixel, while a wrong picture differs smoothly where the
surface is smooth.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.rig import Sensor
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
