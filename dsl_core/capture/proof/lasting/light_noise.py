"""Whether light has the noise that its brightness explains: photons tell the gain of a camera.

Of so many electrons, the noise is their square root, whatever scene and lamp. Counts whose variance is
another multiple of the light than when the camera was calibrated have another gain, and so have reflectances.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from dsl_core.capture.proof.code.code_pairs import Pair
from dsl_core.capture.proof.noise import Noise
from dsl_core.capture.proof.raster import Floats, Raster
from dsl_core.optics.sensor import step_of
from dsl_core.solve.robust import robust_std

#: Variance over the one stated, up and down, from which on a gain is another; self-tests leave a tenth open.
OTHER = 1.33
#: A gain is the same in all pairs but for this factor: what moves, flickers or is compressed is not.
AGREE = 1.3
#: A pixel counts where light explains this share of the variance, and its contrast so many deviations.
BY_LIGHT, LIT_SIGMAS = 0.7, 12.0
#: Parts of the picture down and across, pixels that a part has to have, and parts that are needed.
PARTS, FEWEST, FEWEST_PARTS = 4, 150, 4
#: Pairs that are asked: the widest stripes, as finer ones show what trembles as well.
PAIRS = 4
#: Variance over the one stated that no exposure has: pictures without any noise.
NO_NOISE = 0.04


@dataclass(frozen=True)
class LightNoise:
    """Variance of light over what the calibration states of light so bright."""

    times: float

    @property
    def sentence(self) -> str:
        """What is wrong, and what to do."""
        others = "" if self.times > 1 else " Or it smooths its pictures (noise reduction, binning)."
        return (
            f"Light has {self.times:.2f} times the noise (variance) that the calibration gives light so"
            f" bright: the camera's gain is about {20 * np.log10(self.times):+.0f} dB against its self-test,"
            f" and reflectances are {self.times:.2f} times what they should be.{others} Set the gain as it"
            " was for the self-test, and scan again; if nobody changed it, repeat the self-test, which"
            " measures noise and gain."
        )


def light_noise(pairs: Mapping[int, Pair], noise: Noise, raster: Raster) -> LightNoise | None:
    """Noise of light by the ``pairs`` of a code, as `noise_times`; None if it is as stated, or not known."""
    times = noise_times(pairs, noise, raster)
    return LightNoise(times) if times is not None and not is_stated(times) else None


def is_stated(times: float) -> bool:
    """Whether noise that is so many times the one stated may be that."""
    return 1 / OTHER <= times <= OTHER


def noise_times(pairs: Mapping[int, Pair], noise: Noise, raster: Raster) -> float | None:
    """Variance of light over the one stated, by the ``pairs`` of a code, rasters by their number.

    Every pair adds up to the same light, so that sums differ by noise alone. None where there is too little
    light to tell, or pairs disagree.
    """
    found = _times_of_pairs(pairs, noise, raster)
    if len(found) < PAIRS - 1 or min(found) < NO_NOISE or max(found) > AGREE * min(found):
        return None
    # All of them are beyond what a self-test leaves open, or none is.
    return 1.0 if min(found) <= OTHER and max(found) >= 1 / OTHER else float(np.median(found))


def has_no_noise(pairs: Mapping[int, Pair], noise: Noise, raster: Raster) -> bool:
    """Whether the ``pairs`` of a code, as for `noise_times`, have the same sums to the count."""
    found = _times_of_pairs(pairs, noise, raster)
    return bool(found) and min(found) < NO_NOISE


def _times_of_pairs(pairs: Mapping[int, Pair], noise: Noise, raster: Raster) -> list[float]:
    """The variance of each of the widest pairs and the next one over that stated, where light tells."""
    chosen = [pairs[number] for number in sorted(pairs)[:PAIRS]]
    if len(chosen) < PAIRS:
        return []
    # Pictures of less bits than the camera's have the noise of rounding, too.
    values = np.bincount(np.concatenate([each for pair in chosen for each in pair]))
    rounding = np.float32(step_of(values) ** 2 / 12)
    found = (_times(one, other, noise, raster, rounding) for one, other in pairwise(chosen))
    return [each for each in found if each is not None]


def _times(one: Pair, other: Pair, noise: Noise, raster: Raster, rounding: np.float32) -> float | None:
    """Variance of the difference of two sums over the one stated; None where light says too little.

    Each picture has the variance of ``rounding`` besides.
    """
    stated = Noise(noise.stated)
    every = (*one, *other)
    variance = np.sum([stated.variance(each) for each in every], axis=0) + len(every) * rounding
    low, high = np.minimum.reduce(every), np.maximum.reduce(every)
    used = (high.astype(np.float32) - low > LIT_SIGMAS * np.sqrt(variance)) & (
        high < stated.sensor.full_scale_dn
    )
    used &= len(every) * (stated.least_variance + rounding) < (1 - BY_LIGHT) * variance
    if int(used.sum()) < FEWEST * FEWEST_PARTS:
        return None
    before, now = (np.add(*pair, dtype=np.float32) for pair in (other, one))
    level = np.float32(2 * stated.sensor.black_level_dn)
    # A lamp that is a little brighter gives surfaces of many colours differences of their own.
    light = np.float32((now - level)[used].mean() / (before - level)[used].mean())
    apart = np.where(used, now - level - light * (before - level), np.float32(np.nan))
    parts = _by_parts((apart / np.sqrt(variance)).reshape(raster.shape))
    return float(np.median(parts)) if len(parts) >= FEWEST_PARTS else None


def _by_parts(apart: Floats) -> list[float]:
    """Variance in each part of the picture (rows, columns) that has pixels enough, by steps along rows.

    To the next pixel of the same colour, what differs smoothly changes little.
    """
    steps = (apart[:, 2:] - apart[:, :-2]) / np.float32(np.sqrt(2))
    parts: list[NDArray[np.floating]] = [
        part for rows in np.array_split(steps, PARTS) for part in np.array_split(rows, PARTS, axis=1)
    ]
    known = (part[np.isfinite(part)] for part in parts)
    return [float(robust_std(each)) ** 2 for each in known if each.size >= FEWEST]
