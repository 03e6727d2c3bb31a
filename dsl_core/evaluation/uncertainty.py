"""Whether the standard deviations are honest."""

from __future__ import annotations

from dataclasses import dataclass
from statistics import NormalDist

import numpy as np
from numpy.typing import NDArray

from dsl_core.errors import DecodeError
from dsl_core.solve.normal import BAND_95

Floats = NDArray[np.float64] | NDArray[np.float32]
Mask = NDArray[np.bool_]

#: A value is decided by data, not by the prior, from this data share on.
DECIDED_FROM = 0.5
_LEVELS = (0.5, 0.68, 0.8, 0.9, 0.95, 0.99)


@dataclass(frozen=True)
class HonestyCheck:
    """Observed against promised coverage.

    ``coverage_95`` is the share of values whose 95 % band holds the truth; ``curve`` lists (promised,
    observed) pairs; ``spread`` is the RMS of error divided by standard deviation, 1 when it is honest,
    above 1 when it is too sure; ``share`` is the part of the values with truth that was counted.
    """

    count: int
    share: float
    coverage_95: float
    spread: float
    curve: tuple[tuple[float, float], ...]


def check_honesty(values: Floats, truth: Floats, std: Floats, decided: Mask | None = None) -> HonestyCheck:
    """Compare errors with standard deviations over finite values, optionally only where ``decided``.

    Arrays have equal or broadcastable shapes. Raises `DecodeError` when nothing can be compared.
    """
    error = np.abs(np.asarray(values, np.float64) - truth)
    known = np.isfinite(error) & np.isfinite(std)
    counted = known if decided is None else known & decided
    if not counted.any():
        raise DecodeError(
            "No value has a truth, a standard deviation and enough data, so the uncertainties cannot be"
            " checked; look at data_share and the flags of the result."
        )
    deviation = np.broadcast_to(std, error.shape)[counted].astype(np.float64)
    error = error[counted]
    # A promised error of zero is kept only by an exact value.
    curve = tuple(
        (level, float(np.mean(error <= NormalDist().inv_cdf(0.5 + level / 2) * deviation)))
        for level in _LEVELS
    )
    positive = deviation > 0
    score = error[positive] / deviation[positive]
    return HonestyCheck(
        count=error.size,
        share=error.size / int(known.sum()),
        coverage_95=float(np.mean(error <= BAND_95 * deviation)),
        spread=float(np.sqrt(np.mean(score**2))) if score.size else float("inf"),
        curve=curve,
    )
