"""Spectra as their shapes: normalised, differentiated, without their continuum; deviations go along."""

from __future__ import annotations

from enum import Enum

import numpy as np
from numpy.typing import NDArray

from dsl_core.analysis.band_noise import usual_correlation

Floats = NDArray[np.float64]
Given = NDArray[np.float32] | NDArray[np.float64]


class Transform(Enum):
    """What is drawn instead of reflectance; the value names it."""

    NONE = "reflectance"
    NORMALISED = "normalised to mean 1"
    DERIVATIVE = "derivative (1/nm)"
    CONTINUUM = "continuum removed"


def transformed(
    nm: Given, mean: Given, std: Given | None, transform: Transform
) -> tuple[Floats, Floats | None]:
    """A spectrum (bands,) and its deviations after a transform.

    Deviations are propagated to first order, with the correlation that bands at ``nm`` usually have; the
    level, for instance, leaves a normalised spectrum. Without deviations there are none. A spectrum that is
    not finite, or has no level, stays as it is or becomes NaN.
    """
    values = np.asarray(mean, np.float64)
    spread = None if std is None else np.asarray(std, np.float64)
    if transform is Transform.NONE:
        return values, spread
    if len(values) < 3 or not np.isfinite(values).all():
        return np.full(len(values), np.nan), None if spread is None else np.full(len(values), np.nan)
    found, slope = _FUNCTIONS[transform](np.asarray(nm, np.float64), values)
    if spread is None:
        return found, None
    factor = slope * np.nan_to_num(spread)
    variance = np.einsum("ij,jk,ik->i", factor, usual_correlation(nm), factor)
    return found, np.sqrt(np.maximum(variance, 0))


def _normalised(nm: Floats, values: Floats) -> tuple[Floats, Floats]:
    """Divided by the mean, with the derivative (bands, bands) of the answer by the spectrum."""
    count, level = len(values), values.mean()
    if abs(level) < 1e-9:
        return np.full(count, np.nan), np.full((count, count), np.nan)
    found = values / level
    return found, (np.eye(count) - found[:, None] / count) / level


def _derivative(nm: Floats, values: Floats) -> tuple[Floats, Floats]:
    slope: Floats = np.asarray(np.gradient(np.eye(len(nm)), nm, axis=0), np.float64)
    return slope @ values, slope


def _continuum_removed(nm: Floats, values: Floats) -> tuple[Floats, Floats]:
    """Divided by the upper convex hull (R. N. Clark, T. L. Roush, J. Geophys. Res. 89, 1984)."""
    weights = hull_weights(nm, values)
    hull = weights @ values
    if (hull <= 1e-9).any():
        return np.full(len(nm), np.nan), np.full((len(nm), len(nm)), np.nan)
    found = values / hull
    return found, (np.eye(len(nm)) - found[:, None] * weights) / hull[:, None]


def hull_weights(nm: Floats, values: Floats) -> Floats:
    """Weights (bands, bands) that turn a spectrum into its upper convex hull at its own bands."""
    corners: list[int] = []
    for band in range(len(nm)):
        while len(corners) > 1:
            first, last = corners[-2], corners[-1]
            turn = (nm[last] - nm[first]) * (values[band] - values[first])
            turn -= (values[last] - values[first]) * (nm[band] - nm[first])
            if turn < 0:
                break
            corners.pop()
        corners.append(band)
    unit = np.eye(len(nm))[corners]
    return np.stack([np.interp(nm, nm[corners], column) for column in unit.T], axis=1)


_FUNCTIONS = {
    Transform.NORMALISED: _normalised,
    Transform.DERIVATIVE: _derivative,
    Transform.CONTINUUM: _continuum_removed,
}
