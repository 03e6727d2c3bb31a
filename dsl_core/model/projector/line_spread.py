"""The projector's line spread as it was measured: no shape is assumed."""

from __future__ import annotations

import math
from typing import Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from dsl_core.model.base import Record

#: Widths of a Gaussian beyond which nothing of it counts.
REACH = 6.0


class LineSpread(Record):
    """Light of an infinitely narrow line against the distance in columns: a sum of narrow Gaussians.

    Gaussian ``i`` is centred at ``first_px + step_px * i``, has the rms width ``core_px`` and holds the share
    ``shares[i]`` of the light. A step as wide as the Gaussians makes any smooth curve; each further Gaussian
    blur only widens the core. Half of the light is on either side of zero: there stripes of a binary code
    meet their inverse, and by these columns are calibrated.
    """

    first_px: float
    step_px: float = Field(gt=0)
    core_px: float = Field(gt=0)
    shares: tuple[float, ...] = Field(min_length=1)

    @model_validator(mode="after")
    def _check(self) -> Self:
        shares = np.array(self.shares)
        if (shares < 0).any() or abs(shares.sum() - 1) > 1e-6:
            raise ValueError(
                f"the shares of a line spread must be zero or more and add up to 1, given {shares.min():g}"
                f" at least and {shares.sum():g} in all; divide them by their sum"
            )
        if abs(self._before(0.0) - 0.5) > 1e-3:
            raise ValueError(
                f"half of a line spread's light must be before 0 px, given {self._before(0.0):.4f} of it;"
                " move first_px"
            )
        return self

    @classmethod
    def of(cls, shares: NDArray[np.float64], step_px: float) -> Self:
        """The curve of shares of any sum, with its median moved to zero and a core as wide as the step."""
        used = np.flatnonzero(shares > 0)
        kept = shares[used[0] : used[-1] + 1] / shares[used].sum()
        raw = cls.model_construct(first_px=0.0, step_px=step_px, core_px=step_px, shares=tuple(kept.tolist()))
        low, high = -REACH * step_px, (len(kept) - 1 + REACH) * step_px
        while high - low > 1e-9:
            middle = (low + high) / 2
            low, high = (middle, high) if raw._before(middle) < 0.5 else (low, middle)
        return cls(first_px=-low, step_px=step_px, core_px=step_px, shares=raw.shares)

    @property
    def centres_px(self) -> NDArray[np.float64]:
        """Centres of the Gaussians."""
        return self.first_px + self.step_px * np.arange(len(self.shares), dtype=np.float64)

    def _before(self, place_px: float) -> float:
        """Share of the light before a place."""
        from scipy.special import ndtr

        return float(ndtr((place_px - self.centres_px) / self.core_px) @ self.shares)

    @property
    def rms_px(self) -> float:
        """Root mean square distance of the light from its centroid."""
        return math.sqrt(float((self.centres_px - self.lean_px) ** 2 @ self.shares) + self.core_px**2)

    @property
    def lean_px(self) -> float:
        """How far the mean place of the light is from zero, its median."""
        return float(self.centres_px @ self.shares)

    def blurred(self, blur_px: float) -> Self:
        """The same after a further Gaussian blur."""
        return self.model_copy(update={"core_px": math.hypot(self.core_px, blur_px)})

    def stretched(self, factor: float) -> Self:
        """The same with all distances times a factor."""
        sizes = {name: getattr(self, name) * factor for name in ("first_px", "step_px", "core_px")}
        return self.model_copy(update=sizes)


def zero_std_px(lean_px: float) -> float:
    """Deviation of where columns are counted from: the median of a line's light, as by codes, or its mean."""
    return abs(lean_px) / math.sqrt(3)


#: How a narrow line's light is spread: the rms width of a Gaussian (px), or a measured curve.
Spread = float | LineSpread


def stretched(spread: Spread, factor: float) -> Spread:
    """A spread with all distances times a factor."""
    return spread.stretched(factor) if isinstance(spread, LineSpread) else spread * factor
