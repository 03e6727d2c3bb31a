"""Deviations and weights that a few wrong values do not decide.

Linear fits repeat weighted least squares with weights from their own residuals (P. J. Huber, "Robust
Statistics", 1981).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dsl_core.solve.normal import STD_OF_MEDIAN_SIZE

Floats = NDArray[np.float64]

#: Rounds of a linear fit with weights from its own residuals.
ROUNDS = 6


def robust_std(residual: NDArray[np.floating], axis: int | None = None) -> Floats:
    """Standard deviation of residuals about zero by their median size (scaled as normal ones need it).

    Along ``axis``, or of all.
    """
    return np.asarray(STD_OF_MEDIAN_SIZE * np.median(np.abs(residual), axis=axis))


def weighted_median(values: NDArray[np.floating], weight: NDArray[np.floating]) -> float:
    """The value with half of the weight on either side, of values (n,) with weights (n,)."""
    order = np.argsort(values)
    total = np.cumsum(weight[order], dtype=np.float64)
    return float(values[order][np.searchsorted(total, total[-1] / 2)])


def rms(values: NDArray[np.floating]) -> float:
    """Root mean square of all values, in their unit; NaN (with a warning) without any."""
    return float(np.sqrt(np.mean(values**2)))


def huber_weights(residual: Floats, sigma: Floats, limit_sigmas: float) -> tuple[Floats, float]:
    """Inverse variances (n,) with Huber's weights ``min(1, limit / |r|)``, and the scatter over ``sigma``.

    That factor is at least one; residuals beyond ``limit_sigmas`` of the deviation times it weigh less.
    """
    scale = max(1.0, float(robust_std(residual / sigma)))
    off = np.abs(residual) / (scale * sigma)
    return np.minimum(1.0, limit_sigmas / np.maximum(off, 1e-12)) / (scale * sigma) ** 2, scale


def geman_mcclure_weights(residual: Floats, scatter: float) -> Floats:
    """Weights of Geman and McClure, ``1 / (1 + (r / 3 s)^2)^2`` of residuals r (n,) and their scatter s."""
    return np.asarray(1 / (1 + (residual / (3 * scatter)) ** 2) ** 2, np.float64)


def robust_linear(design: Floats, values: Floats) -> tuple[Floats, Floats, float]:
    """Linear fit of values (n,) by a design (n, k) in which values far off count next to nothing.

    Weights are those of `geman_mcclure_weights`.
    Returns the coefficients (k,), the inverse (k, k) of the weighted normal matrix, and the scatter of
    the residuals in the unit of the values: their covariance is the inverse times the scatter squared.
    """
    weight = np.ones_like(values)
    for _ in range(ROUNDS):
        heavy = design * weight[:, None]
        inverse = np.linalg.pinv(heavy.T @ design, hermitian=True)
        found = inverse @ (heavy.T @ values)
        residual = values - design @ found
        scatter = float(robust_std(residual)) + 1e-12
        weight = geman_mcclure_weights(residual, scatter)
    return found, np.asarray(inverse, np.float64), scatter
