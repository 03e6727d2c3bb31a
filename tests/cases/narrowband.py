"""Reflectance of flat patches under narrow-band filters: filters, flat field, reference."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dsl_core.errors import DecodeError
from dsl_core.model.spectral import SpectralCurve

Floats = NDArray[np.float64]

_IRLS_ITERATIONS = 10
#: Residuals beyond this many robust standard deviations lose weight.
_HUBER = 1.345


def pass_band(curve: SpectralCurve, half_width_nm: float = 25.0, floor: float = 0.02) -> SpectralCurve:
    """The filter alone: zero further than ``half_width_nm`` from the peak and below ``floor`` of it.

    Transmittance measured with a projector lamp is a quotient of two small numbers where the lamp is
    weak; left in, that noise far from the band outweighs the band itself.
    """
    at, values = np.array(curve.wavelengths_nm), np.array(curve.values)
    visible = (at > 380) & (at < 780)
    peak = int(np.argmax(np.where(visible, values, -np.inf)))
    keep = visible & (np.abs(at - at[peak]) <= half_width_nm) & (values >= floor * values[peak])
    return SpectralCurve.of(at, np.where(keep, values, 0.0), curve.unit)


def centroid_nm(curve: SpectralCurve) -> float:
    """Centre of gravity of a curve, nm."""
    return float(np.average(curve.wavelengths_nm, weights=curve.values))


def band_means(wavelengths_nm: Floats, spectra: Floats, band: SpectralCurve) -> Floats:
    """Mean of spectra, shape (wavelengths, n), weighted by a band, on an even grid; shape (n,)."""
    return np.asarray(np.average(spectra, axis=0, weights=band.at(wavelengths_nm)))


def flat_field(ratio: Floats, uniform: NDArray[np.bool_], order: int = 2) -> Floats:
    """Smooth illumination from an image of it that is valid only on a uniform surface; shape (h, w).

    The logarithm of ``ratio`` is fitted by a polynomial in x and y, robustly (Huber), over the pixels
    ``uniform`` and continued elsewhere; the mean of the fit over ``uniform`` is 1. An order above 2 is
    safe only where the uniform pixels surround the rest. Raises `DecodeError` when they are too few.
    """
    usable = uniform & np.isfinite(ratio) & (ratio > 0)
    basis = _polynomials(ratio.shape, order)
    if usable.sum() < 10 * basis.shape[-1]:
        raise DecodeError(
            f"Only {usable.sum()} pixels of the uniform surface are usable; a flat field of order {order}"
            f" needs {10 * basis.shape[-1]}. Show more of it, or lower the order."
        )
    rows, target = basis[usable], np.log(ratio[usable])
    weight = np.ones_like(target)
    for _ in range(_IRLS_ITERATIONS):
        coefficients = np.linalg.lstsq(rows * weight[:, None], target * weight, rcond=None)[0]
        residual = np.abs(target - rows @ coefficients)
        limit = _HUBER * max(1.4826 * float(np.median(residual)), 1e-9)
        weight = np.sqrt(limit / np.maximum(residual, limit))
    field = np.exp(basis @ coefficients)
    return np.asarray(field / field[usable].mean())


def _polynomials(shape: tuple[int, ...], order: int) -> Floats:
    y, x = (np.linspace(-1, 1, n) for n in shape)
    terms = [np.multiply.outer(y**j, x**i) for i in range(order + 1) for j in range(order + 1 - i)]
    return np.stack(terms, axis=-1)
