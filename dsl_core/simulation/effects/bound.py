"""The most that an effect changes."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class EffectBound:
    """The most that an effect changes in any pixel of any picture of a plan, and what decides it.

    ``dn`` in counts, ``sigmas`` in standard deviations of the darkest pixel's noise.
    """

    dn: float
    sigmas: float
    reason: str
