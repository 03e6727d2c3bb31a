"""What a binary code says of its own pictures, before anything else is known.

Light adds up, whatever surfaces do with it: a pattern and its inverse together are white and black together,
for every pair of a code. A picture that shows anything else breaks the sum of its pair.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from dsl_core.capture.proof.finding import Verdict
from dsl_core.capture.proof.noise import Noise
from dsl_core.capture.proof.raster import Counts, Floats, Raster
from dsl_core.optics.seen_noise import noise_excess

#: A pixel breaks the sum by more than this share of its contrast, and by so many standard deviations.
BROKEN_SHARE, BROKEN_SIGMAS = 0.3, 6.0
#: A pixel counts if its contrast is at least so many standard deviations.
LIT_SIGMAS = 12.0
#: Pixels that must break the sum, and their share of those that count.
FEWEST_BROKEN, LEAST_BROKEN = 8, 0.005
#: Mean difference of two pictures of one pattern, as a share of the contrast.
ALIKE = 0.08
#: Brightness, relative to what was expected, that is taken for the same.
SAME_LIGHT = (0.7, 1.4)

Pair = tuple[Counts, Counts]


class CodePairs:
    """Pairs of one setting as far as they are there, each of a pattern and its inverse."""

    def __init__(self, noise: Noise) -> None:
        """Start without any."""
        self._noise = noise
        self.pairs: dict[int, Pair] = {}
        self._least_excess = np.inf

    def contrast(self, more: Iterable[Pair] = ()) -> tuple[Floats, Floats, NDArray[np.bool_]]:
        """Darkest and brightest counts of every pixel in all pairs and ``more``, and where both say enough.

        Saturated pixels do not, unless it is only ``more`` that saturates them.
        """
        both = [*self.pairs.values(), *more]
        low = np.minimum.reduce([picture for pair in both for picture in pair])
        high = np.maximum.reduce([picture for pair in both for picture in pair])
        sigma = np.sqrt(self._noise.variance(low) + self._noise.variance(high))
        dark, bright = low.astype(np.float32), high.astype(np.float32)
        known = [picture for pair in self.pairs.values() for picture in pair]
        sound = np.maximum.reduce(known) < self._noise.sensor.full_scale_dn if known else True
        return dark, bright, (bright - dark > LIT_SIGMAS * sigma) & sound

    def sum(self) -> Floats | None:
        """Pattern and inverse together, the median over the pairs; None without any."""
        sums = [_together(pair) for pair in list(self.pairs.values())[-9:]]
        return np.asarray(np.median(sums, axis=0), np.float32) if sums else None

    def learn_noise(self, pair: Pair, raster: Raster) -> None:
        """Believe what a further pair shows of the camera's noise, where that is more than stated.

        Of all pairs so far the least counts: a wrong picture looks like noise at most.
        """
        if not self.pairs:
            return
        other = next(reversed(self.pairs.values()))
        one, before = ((a.reshape(raster.shape), b.reshape(raster.shape)) for a, b in (pair, other))
        stated = self._noise.stated
        excess = noise_excess(one, before, Noise(stated).variance, stated.full_scale_dn)
        if excess is not None:
            self._least_excess = min(self._least_excess, excess)
            self._noise.take(self._least_excess)

    def broken(self, pair: Pair, expected: Floats | None) -> NDArray[np.bool_] | None:
        """Pixels that break the sum of a pair, flat; None if it holds or nothing can be told.

        Light beyond full scale is lost: that the sum of a saturated pixel is too small breaks nothing. So it
        is with white where fine stripes, blurred, just do not saturate.
        """
        if expected is None:
            return None
        dark, bright, lit = self.contrast([pair])
        sigma = np.sqrt(2 * (self._noise.variance(pair[0]) + self._noise.variance(pair[1])))
        limit = np.maximum(BROKEN_SHARE * (bright - dark), BROKEN_SIGMAS * sigma)
        apart = _together(pair) - expected
        is_clipped = np.maximum(*pair) >= self._noise.sensor.full_scale_dn
        found = lit & (np.abs(apart) > limit) & ~(is_clipped & (apart < 0))
        enough = max(FEWEST_BROKEN, LEAST_BROKEN * int(lit.sum()))
        return found if int(found.sum()) > enough else None

    def brightness(self, pair: Pair, expected: Floats) -> tuple[float, float] | None:
        """By how much pattern and inverse are too dark or bright, if that alone explains a broken sum."""
        _, _, lit = self.contrast([pair])
        black = np.float32(self._noise.sensor.black_level_dn)
        light = [picture[lit].astype(np.float64) - black for picture in pair]
        wanted = expected[lit].astype(np.float64) - 2 * black
        matrix = np.array([[a @ b for b in light] for a in light])
        if np.linalg.cond(matrix) > 1e6:
            return None
        factors = np.linalg.solve(matrix, [a @ wanted for a in light])
        left = factors[0] * light[0] + factors[1] * light[1] - wanted
        if (factors <= 0).any() or np.abs(left).mean() > ALIKE * wanted.mean():
            return None
        ratios = (float(1 / factors[0]), float(1 / factors[1]))
        return ratios if any(not SAME_LIGHT[0] < ratio < SAME_LIGHT[1] for ratio in ratios) else None


def alike(one: Counts, other: Counts, contrast: Floats, lit: NDArray[np.bool_], noise: float = 0.0) -> bool:
    """Whether two pictures show the same pattern, where ``lit``; ``noise`` is its mean share of contrast."""
    if not lit.any():
        return False
    apart = np.abs(one[lit].astype(np.float32) - other[lit].astype(np.float32)) / contrast[lit]
    return bool(np.minimum(apart, 1).mean() < math.hypot(ALIKE, noise))


def end_of(broken: NDArray[np.bool_], counted: NDArray[np.bool_]) -> bool:
    """Whether broken pixels are those above or below some row alone: the mark of a torn picture."""
    order = broken[counted]
    half = order.size // 20
    upper, lower = int(order[:half].sum()), int(order[-half:].sum()) if half else 0
    return bool(half) and min(upper, lower) < 0.1 * max(upper, lower)


def _together(pair: Pair) -> Floats:
    return pair[0].astype(np.float32) + pair[1].astype(np.float32)


def dominant(broken: NDArray[np.bool_], counted: NDArray[np.bool_]) -> Verdict:
    """Torn or simply another picture."""
    return Verdict.TORN if end_of(broken, counted) else Verdict.OTHER
