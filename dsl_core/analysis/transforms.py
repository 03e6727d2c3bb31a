"""Spectra as their shapes: normalised, differentiated, without their continuum; deviations go along."""

from __future__ import annotations

from enum import Enum

import numpy as np
from numpy.typing import NDArray

from dsl_core.analysis.band_noise import usual_correlation

Floats = NDArray[np.float64]
Given = NDArray[np.float32] | NDArray[np.float64]


#: Spectra drawn for deviations without continuum; they state those within about 10 %.
_DRAWS = 100
#: Where a smaller share of them has a continuum, deviations are not known.
_LEAST_SHARE = 0.9


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

    Deviations are propagated with the correlation that bands at ``nm`` usually have; the level, for instance,
    leaves a normalised spectrum. To first order, but for the continuum: noise lifts it to its own peaks, so
    that deviations contain by how much. Without deviations there are none; where one is not known (NaN), none
    of the answer is. A spectrum that is not finite, or has no level, stays as it is or becomes NaN.
    """
    values = np.asarray(mean, np.float64)
    spread = None if std is None else np.asarray(std, np.float64)
    if transform is Transform.NONE:
        return values, spread
    if len(values) < 3 or not np.isfinite(values).all():
        return np.full(len(values), np.nan), None if spread is None else np.full(len(values), np.nan)
    bands_nm = np.asarray(nm, np.float64)
    if spread is not None and not np.isfinite(spread).all():
        return transformed(nm, mean, None, transform)[0], np.full(len(values), np.nan)
    if transform is Transform.CONTINUUM:
        found = _continuum_removed(bands_nm, values)
        return found, None if spread is None else _drawn(bands_nm, values, spread, found)
    found, slope = _FUNCTIONS[transform](bands_nm, values)
    if spread is None:
        return found, None
    factor = slope * spread
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


def _drawn(nm: Floats, values: Floats, std: Floats, found: Floats) -> Floats:
    """How far ``found``, without its continuum, is from what it is without noise: root mean square (bands,).

    As much noise again makes the sum larger by the root of 2, and so how far peaks of noise lift the hull.
    """
    root = np.linalg.cholesky(usual_correlation(nm))
    draws = values + std * (np.random.default_rng(0).standard_normal((_DRAWS, len(nm))) @ root.T)
    moves = np.stack([_continuum_removed(nm, draw) - found for draw in draws])
    # Noise of a band at an end that is unsure takes the hull of a few draws to zero; they have no answer.
    moves = moves[np.isfinite(moves).all(1)]
    if len(moves) < _LEAST_SHARE * _DRAWS:
        return np.full(len(nm), np.nan)
    return np.asarray(np.hypot(moves.std(0), moves.mean(0) / (np.sqrt(2) - 1)))


def _continuum_removed(nm: Floats, values: Floats) -> Floats:
    """Divided by the upper convex hull (R. N. Clark, T. L. Roush, J. Geophys. Res. 89, 1984)."""
    hull = upper_hull(nm, values)
    return values / hull if (hull > 1e-9).all() else np.full(len(nm), np.nan)


def upper_hull(nm: Floats, values: Floats) -> Floats:
    """The upper convex hull of a spectrum at its own bands (bands,)."""
    corners: list[tuple[float, float]] = []
    for x, y in zip(nm.tolist(), values.tolist(), strict=True):
        while len(corners) > 1:
            (first_x, first_y), (last_x, last_y) = corners[-2:]
            if (last_x - first_x) * (y - first_y) < (last_y - first_y) * (x - first_x):
                break
            corners.pop()
        corners.append((x, y))
    return np.asarray(np.interp(nm, *np.transpose(corners)))


_FUNCTIONS = {
    Transform.NORMALISED: _normalised,
    Transform.DERIVATIVE: _derivative,
}
