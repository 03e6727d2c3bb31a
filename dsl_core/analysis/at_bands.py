"""Spectra of other instruments at the bands of a result, averaged as those bands average."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsl_core.errors import CalibrationError
from dsl_core.model.spectral import SpectralCurve

Floats = NDArray[np.float64]
#: Samples of a band's triangle across its width at half height.
_PER_WIDTH = 32
#: At most this share of a band's triangle may lie beyond the ends of a spectrum.
MOST_BEYOND = 0.5


@dataclass(frozen=True)
class BandValues:
    """A spectrum at bands (bands,): values, and the deviations of those values."""

    values: Floats
    std: Floats


def band_widths_nm(bands_nm: Floats, stated_nm: float | None = None) -> Floats:
    """Full width at half height (nm) of bands (bands,): the distance of bands where nobody states it."""
    if stated_nm is not None:
        return np.full(len(bands_nm), stated_nm)
    if len(bands_nm) < 2:
        return np.ones(len(bands_nm))
    return np.asarray(np.gradient(np.asarray(bands_nm, np.float64)))


def band_weights(nm: Floats, bands_nm: Floats, widths_nm: Floats) -> Floats:
    """Weights (bands, samples) that turn a spectrum, linear between its samples, into band means.

    A band of a result is the mean over a triangle, centred on it and ``widths_nm`` (bands,) wide at half
    height. Where it reaches beyond the ends of the spectrum, the rest of it decides; a row is NaN where more
    than `MOST_BEYOND` does.
    """
    weights = np.full((len(bands_nm), len(nm)), np.nan)
    at = np.linspace(-1.0, 1.0, 2 * _PER_WIDTH + 1)
    triangle = 1 - np.abs(at)
    for band, (centre, width) in enumerate(zip(bands_nm, widths_nm, strict=True)):
        # Samples of the spectrum itself are nodes too, so that the narrowest line of it counts in full.
        inside = nm[np.abs(nm - centre) <= width]
        fine = np.union1d(centre + at * width, inside)
        mass = np.interp(fine, centre + at * width, triangle) * np.gradient(fine)
        covered = (fine >= nm[0] - 1e-9) & (fine <= nm[-1] + 1e-9)
        total = mass[covered].sum()
        if total < (1 - MOST_BEYOND) * mass.sum() or total <= 0:
            continue
        weights[band] = _spread(fine[covered], mass[covered] / total, nm)
    return weights


def _spread(fine: Floats, mass: Floats, nm: Floats) -> Floats:
    """Masses at wavelengths handed to the two samples around each, in proportion."""
    if len(nm) == 1:
        return np.array([mass.sum()])
    right = np.clip(np.searchsorted(nm, fine), 1, len(nm) - 1)
    share = np.clip((fine - nm[right - 1]) / (nm[right] - nm[right - 1]), 0, 1)
    row = np.bincount(right, mass * share, len(nm)) + np.bincount(right - 1, mass * (1 - share), len(nm))
    return np.asarray(row)


def at_bands(curve: SpectralCurve, bands_nm: Floats, width_nm: float | None = None) -> BandValues:
    """A spectrum at the bands (nm) of a result, a mean over the triangle of each.

    ``width_nm`` is how wide they are (`stated_band_width_nm`); their distance, unless it is known. Raises
    `CalibrationError` where the spectrum does not cover them.
    The deviation holds that of the curve, if it states one, and what its sampling leaves open where it is
    coarser than the bands: half of the difference between straight lines and a smooth curve between samples.
    """
    from scipy.interpolate import PchipInterpolator

    nm, values = np.asarray(curve.wavelengths_nm), np.asarray(curve.values)
    widths = band_widths_nm(bands_nm, width_nm)
    weights = band_weights(nm, bands_nm, widths)
    missing = ~np.isfinite(weights).all(1)
    if missing.any():
        raise CalibrationError(
            f"It covers {nm[0]:g} to {nm[-1]:g} nm; the bands from {bands_nm[0]:g} to {bands_nm[-1]:g} nm are"
            " needed."
        )
    found = weights @ values
    variance = np.zeros(len(bands_nm)) if curve.std is None else weights**2 @ np.square(curve.std)
    if len(nm) > 2:
        between = np.abs(PchipInterpolator(nm, values)(np.clip(bands_nm, nm[0], nm[-1])) - curve.at(bands_nm))
        is_coarse = np.interp(bands_nm, nm, np.gradient(nm)) > widths
        variance += np.where(is_coarse, between / 2, 0.0) ** 2
    return BandValues(found, np.sqrt(variance))
