"""What an effect changes at most, and how far pictures may be from those with all effects.

Imports nothing heavy: the window reads it too.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

from dsl_core.errors import DeviceError


@dataclass(frozen=True)
class EffectBound:
    """The most that an effect changes in any pixel of any picture of a plan, and what decides it.

    ``dn`` in counts, ``sigmas`` in standard deviations of the darkest pixel's noise.
    """

    dn: float
    sigmas: float
    reason: str


@dataclass(frozen=True)
class Tolerance:
    """How far a picture may be from that with all effects, in counts or in noise of a dark pixel."""

    value: float = 1.0
    unit: str = "DN"

    @classmethod
    def of(cls, text: str) -> Tolerance:
        """A tolerance from ``1``, ``0.5 DN`` or ``2 sigma``; raises `DeviceError`.

        >>> Tolerance.of("0.5 sigma")
        Tolerance(value=0.5, unit='sigma')
        """
        match = re.fullmatch(r"\s*(\d+\.?\d*|\.\d+)\s*(DN|sigmas?)?\s*", text, re.IGNORECASE)
        if match is None:
            raise DeviceError(
                f"The tolerance of effects must be a number of DN or of sigmas, like 1, 0.5DN or 2sigma, not"
                f" {text!r}."
            )
        return cls(float(match[1]), "sigma" if (match[2] or "").lower().startswith("sigma") else "DN")

    def of_bound(self, bound: EffectBound) -> float:
        """A bound in the tolerance's unit."""
        return bound.sigmas if self.unit == "sigma" else bound.dn

    def __str__(self) -> str:
        """What `of` reads; never with an exponent, which it refuses."""
        return f"{np.format_float_positional(self.value, trim='-')} {self.unit}"


ONE_DN = Tolerance()
