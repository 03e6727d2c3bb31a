"""Deviations and weights that a few wrong values do not decide."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def robust_std(residual: NDArray[np.floating], axis: int | None = None) -> Floats:
    """Standard deviation of residuals about zero by their median size (scaled as normal ones need it)."""
    return np.asarray(1.4826 * np.median(np.abs(residual), axis=axis))


def huber_weights(residual: Floats, sigma: Floats, limit_sigmas: float) -> tuple[Floats, float]:
    """Inverse variances (n,) with Huber's weights, and how many times ``sigma`` the residuals scatter.

    That factor is at least one; residuals beyond ``limit_sigmas`` of the deviation times it weigh less.
    """
    scale = max(1.0, float(robust_std(residual / sigma)))
    off = np.abs(residual) / (scale * sigma)
    return np.minimum(1.0, limit_sigmas / np.maximum(off, 1e-12)) / (scale * sigma) ** 2, scale
