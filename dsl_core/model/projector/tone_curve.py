"""The projector's light against its drive level as it was measured: no power law is assumed."""

from __future__ import annotations

from typing import Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from dsl_core.model.base import Record

#: Most powers of the logarithm of the drive level in a curve.
MOST_TERMS = 5


class ToneCurve(Record):
    """Light above black of a drive level, relative to full drive, such as an S or that of sRGB.

    The logarithm of the light is the sum of ``coefficients[k] * log(level) ** (k + 1)``, so that one
    coefficient alone is a power law, and full drive gives full light. Below ``lowest_level`` nothing was
    measured, and the curve goes on as the power law that it has there. ``rel_std`` is the relative standard
    deviation of the light.
    """

    coefficients: tuple[float, ...] = Field(min_length=1, max_length=MOST_TERMS)
    lowest_level: float = Field(gt=0, lt=1)
    rel_std: float = Field(default=0.0, ge=0)

    @model_validator(mode="after")
    def _check(self) -> Self:
        if not rises(np.array(self.coefficients), self.lowest_level):
            raise ValueError(
                f"more drive must never give less light, given coefficients {self.coefficients};"
                " use fewer of them"
            )
        return self

    def light(self, level: NDArray[np.float64]) -> NDArray[np.float64]:
        """Light above black of drive levels 0..1, relative to full drive, in the shape of ``level``."""
        level = np.asarray(level, np.float64)
        lowest = float(np.log(self.lowest_level))
        x = np.log(np.maximum(level, np.finfo(float).tiny))
        inside = np.maximum(x, lowest)
        powers = np.array([0.0, *self.coefficients])
        log = np.polynomial.polynomial.polyval(inside, powers)
        log += (x - inside) * _slope(powers[1:], np.array(lowest))
        return np.asarray(np.where(level > 0, np.exp(log), 0.0))


def rises(coefficients: NDArray[np.float64], lowest_level: float) -> bool:
    """Whether a curve of these coefficients never falls with more drive, from its lowest level to full."""
    x = np.linspace(np.log(lowest_level), 0.0, 256)
    return bool((_slope(coefficients, x) >= 0).all())


def _slope(coefficients: NDArray[np.float64], x: NDArray[np.float64]) -> NDArray[np.float64]:
    """By how many percent light rises with a percent of drive, at logarithms of the level."""
    powers = np.array([0.0, *coefficients])
    return np.asarray(np.polynomial.polynomial.polyval(x, np.polynomial.polynomial.polyder(powers)))
