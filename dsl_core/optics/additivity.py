"""Whether values of pictures are linear in light, from stripes that lens or surface mix.

Light adds up: where bright and dark stripes mix, a pattern and its inverse together are white and black
together. Only linear values keep that. Pictures for screens, such as sRGB, store half the light as almost
three quarters of the range, so that the sum is too bright by up to half the contrast. Stripes without their
inverse tell it as well: as bright and dark ones are equally wide, a picture of many of them has, on average,
half the light of white.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.figure import with_std
from dsl_core.solve.normal import MEDIAN_OVER_MEAN_STD
from dsl_core.solve.robust import robust_std

Floats = NDArray[np.float64]
Counts = NDArray[np.uint16]
#: Pixels count that white lights by at least this share of the range, and that stay below the upper one.
LEAST_CONTRAST, SATURATED = 0.08, 0.985
#: Noise moves sums of pixels whose contrast is fewer of its deviations: values end at 0, and are divided.
LEAST_SIGMAS = 12.0
#: Pattern and inverse differ by less than this share of the contrast where light is mixed, by more than the
#: other where it is not.
MIXED, PURE = 0.5, 0.9
#: Fewer mixed pixels say nothing of a pair; of more than these, some are taken.
FEWEST, MOST = 60, 8000
#: So many neighbours see the edge of the same stripe, and are one observation.
NEIGHBOURS = 9
#: Exponents that pass for linear: projectors sharpen or scale their pictures, and cameras are not perfect
#: (real ones: 0.86 to 0.94). A sum is off only by more than this share of the contrast.
LINEAR, NOTICEABLE = (0.7, 1.3), 0.03
#: Exponents that pass for sRGB.
SRGB = (1.6, 3.0)
#: Parts of a picture along each side, whose means say how far that of the whole may be off; and the fewest.
PARTS, FEWEST_PARTS = 4, 4
#: The exponent of sRGB, nearly: stripes tell something where this would change their mean.
ALMOST_SRGB = 2.2
#: Exponents that are looked for, and how often their interval is halved.
_BOUNDS, _HALVINGS = (0.2, 6.0), 16


@dataclass(frozen=True)
class Additivity:
    """By how much pattern and inverse together exceed white and black together, of all ``pairs``.

    ``excess`` and ``excess_std`` are shares of the contrast. ``exponent`` is the power of the values that is
    linear in light (1: they are as they are; sRGB: about 2), NaN if there is none between 0.2 and 6. Patterns
    that are ``alone`` exceed half of white by half of that.
    """

    excess: float
    excess_std: float
    exponent: float
    exponent_std: float
    pairs: int
    pixels: int
    alone: bool = False

    @property
    def is_linear(self) -> bool:
        """Whether the values may be linear in light."""
        if abs(self.excess) < NOTICEABLE + 3 * self.excess_std:
            return True
        low, high = LINEAR
        return bool(low - 3 * self.exponent_std < self.exponent < high + 3 * self.exponent_std)

    @property
    def is_srgb(self) -> bool:
        """Whether the values are not linear, but would be once decoded from sRGB."""
        return not self.is_linear and self.excess > 0 and SRGB[0] < self.exponent < SRGB[1]

    @property
    def figure(self) -> str:
        """The excess in words.

        >>> Additivity(0.27, 0.01, 2.1, 0.1, 6, 900, alone=True).figure
        'fine stripes are, on average, 13.5 ± 0.5 % of the contrast brighter than half of white'
        """
        where, share = "brighter" if self.excess > 0 else "darker", 50 if self.alone else 100
        off = (
            f"{with_std(share * abs(self.excess), share * self.excess_std, 1)} % of the contrast {where} than"
        )
        if self.alone:
            return f"fine stripes are, on average, {off} half of white"
        return f"pattern and inverse together are {off} white and black together where stripes meet"


class Telling(Protocol):
    """Pixels of a pair, or of a pattern without its inverse, that can tell whether light adds up."""

    def excess(self, exponent: float) -> float:
        """By how much the light exceeds what it would be, for this power of the values."""

    @property
    def noise(self) -> float:
        """Deviation of the excess of the values as they are."""

    @property
    def pixels(self) -> int:
        """How many pixels tell it."""


@dataclass(frozen=True)
class MixedLight:
    """Pattern, inverse, white and black of a pair, shares of the full scale, shape (4, n).

    ``mixed`` are pixels that see bright and dark stripes at once, ``pure`` those that see one of them.
    """

    mixed: Floats
    pure: Floats

    def excess(self, exponent: float) -> float:
        """The median sum where light is mixed, relative to where it is not: the lamp's drift is in both."""
        # Values below the black level have no power.
        mixed, pure = (np.maximum(values, 1e-6) ** exponent for values in (self.mixed, self.pure))
        reference = float(np.median(_sums(pure))) if pure.shape[1] >= FEWEST else 0.0
        return float(np.median(_sums(mixed))) - reference

    @property
    def noise(self) -> float:
        """Deviation of the median sum."""
        sums = _sums(self.mixed)
        spread = float(robust_std(sums - np.median(sums)))
        return float(MEDIAN_OVER_MEAN_STD * spread / np.sqrt(sums.size / NEIGHBOURS))

    @property
    def pixels(self) -> int:
        """Pixels that see bright and dark stripes at once."""
        return int(self.mixed.shape[1])


@dataclass(frozen=True)
class StripeLight:
    """Pattern, white and black of stripes without an inverse, shares of the full scale, shape (3, n).

    ``part`` (n,) is the number of the part of the picture that a pixel is in.
    """

    values: Floats
    part: NDArray[np.intp]

    def excess(self, exponent: float) -> float:
        """Twice what the mean share of white's light exceeds a half by."""
        return float(self._shares(exponent).mean())

    @property
    def noise(self) -> float:
        """Deviation of the mean, as parts of the picture differ."""
        sums = np.bincount(self.part, self._shares(1.0))
        count = np.bincount(self.part)
        means = sums[count >= FEWEST] / count[count >= FEWEST]
        return float(means.std(ddof=1) / np.sqrt(means.size)) if means.size >= FEWEST_PARTS else np.inf

    @property
    def pixels(self) -> int:
        """Pixels whose mean is taken."""
        return int(self.values.shape[1])

    def _shares(self, exponent: float) -> Floats:
        pattern, white, black = np.maximum(self.values, 1e-6) ** exponent
        shares: Floats = 2 * (pattern - black) / (white - black) - 1
        return shares


def mixed_light(
    pair: tuple[Counts, Counts],
    white: Counts,
    black: Counts,
    full_scale_dn: float,
    black_level_dn: float = 0.0,
) -> MixedLight | None:
    """The pixels of a pair that can tell, of frames (rows, columns) in DN; None if there are too few.

    Pixels whose contrast noise could have made are left out.
    """
    frames = np.stack([frame.ravel() for frame in (*pair, white, black)]).astype(np.float64)
    sound = frames.max(axis=0) < SATURATED * full_scale_dn
    values = (frames - black_level_dn) / max(full_scale_dn - black_level_dn, 1.0)
    contrast = values[2] - values[3]
    sound &= contrast > LEAST_CONTRAST
    values, contrast = values[:, sound], contrast[sound]
    # The noise of a difference says nothing of that of the sum: this choice favours no sums.
    apart = np.abs(values[0] - values[1]) / contrast
    clear = contrast > LEAST_SIGMAS * _noise_of(values[:, apart > PURE])
    values, apart = values[:, clear], apart[clear]
    mixed = values[:, apart < MIXED]
    if mixed.shape[1] < FEWEST:
        return None
    return MixedLight(_some(mixed), _some(values[:, apart > PURE]))


def stripe_light(
    pattern: Counts, white: Counts, black: Counts, full_scale_dn: float, black_level_dn: float = 0.0
) -> StripeLight | None:
    """What stripes without an inverse can tell, of frames (rows, columns) in DN; None if that is nothing.

    They have to be so many that any part of the picture has as many bright as dark ones, and so fine that
    their light is mixed.
    """
    frames = np.stack([pattern, white, black]).astype(np.float64)
    sound = (frames < SATURATED * full_scale_dn).all(axis=0)
    values = (frames - black_level_dn) / max(full_scale_dn - black_level_dn, 1.0)
    sound &= values[1] - values[2] > LEAST_CONTRAST
    rows, columns = (np.arange(size) * PARTS // size for size in pattern.shape)
    found = StripeLight(values[:, sound], (PARTS * rows[:, None] + columns)[sound])
    if found.pixels < FEWEST:
        return None
    telling = abs(found.excess(ALMOST_SRGB) - found.excess(1.0))
    return found if telling > NOTICEABLE + 3 * found.noise else None


def additivity(pairs: Iterable[Telling | None]) -> Additivity | None:
    """What pairs, or patterns without inverse, say together; None when none says anything."""
    told = [pair for pair in pairs if pair is not None]
    if not told:
        return None
    excesses = np.array([pair.excess(1.0) for pair in told])
    noises = np.array([pair.noise for pair in told])
    exponents = np.array([_exponent(pair) for pair in told])
    found = exponents[np.isfinite(exponents)]
    known = 2 * found.size > exponents.size
    alone = isinstance(told[0], StripeLight)
    noise = float(np.sqrt(np.mean(noises**2)))
    return Additivity(
        float(excesses.mean()),
        # The finer stripes are, the more of their light is mixed.
        noise / len(told) ** 0.5 if alone else _deviation(excesses, noise),
        float(np.mean(found)) if known else float("nan"),
        _deviation(found, 0.0) if known else float("nan"),
        len(told),
        sum(pair.pixels for pair in told),
        alone,
    )


def _noise_of(pure: Floats) -> float:
    """Standard deviation of a value, from sums of four where light is not mixed; 0 of too few pixels.

    Two of the four are dark, and may be cut off at 0: their noise is taken for none.
    """
    if pure.shape[1] < FEWEST:
        return 0.0
    sums = pure[0] + pure[1] - pure[2] - pure[3]
    return float(robust_std(sums - np.median(sums)) / np.sqrt(2))


def _some(values: Floats) -> Floats:
    step = -(-values.shape[1] // MOST)
    return values[:, ::step] if step > 1 else values


def _sums(values: Floats) -> Floats:
    pattern, inverse, white, black = values
    sums: Floats = (pattern + inverse - white - black) / (white - black)
    return sums


def _exponent(pair: Telling) -> float:
    """The power of the values that adds up: with higher powers the sum falls."""
    low, high = _BOUNDS
    if not pair.excess(low) > 0 > pair.excess(high):
        return float("nan")
    for _ in range(_HALVINGS):
        middle = (low * high) ** 0.5
        low, high = (middle, high) if pair.excess(middle) > 0 else (low, middle)
    return float((low * high) ** 0.5)


def _deviation(values: Floats, noise: float) -> float:
    """Standard deviation of the mean of pairs, from their spread and at least their noise."""
    spread = float(values.std(ddof=1)) if values.size > 1 else 0.0
    return max(spread, noise) / float(np.sqrt(values.size))
