"""One spectrum against a reference, in figures."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsl_core.errors import DecodeError
from dsl_core.evaluation.spectral import spectral_errors
from dsl_core.model.spectral import SpectralCurve

Floats = NDArray[np.floating[Any]]
#: Fewer common bands than this say nothing about a spectrum.
MIN_BANDS = 5


@dataclass(frozen=True)
class Comparison:
    """How a spectrum differs from a reference over the bands they share.

    ``rmse`` on the reflectance scale, ``delta_e`` CIEDE2000 under D65; ``_scaled`` after the factor ``scale``
    that brings the spectrum closest to the reference. The angle does not depend on scale.
    """

    rmse: float
    angle_rad: float
    delta_e: float
    scale: float
    rmse_scaled: float
    delta_e_scaled: float
    bands: int
    range_nm: tuple[float, float]


def compare(spectrum: Floats, wavelengths_nm: Floats, reference: SpectralCurve) -> Comparison:
    """Compare a spectrum (bands,) with a reference, interpolated linearly, where both have values.

    Raises `DecodeError` when they share too few bands.
    """
    nm = np.asarray(reference.wavelengths_nm)
    shared = (wavelengths_nm >= nm[0]) & (wavelengths_nm <= nm[-1]) & np.isfinite(spectrum)
    count = int(shared.sum())
    if count < MIN_BANDS:
        raise DecodeError(
            f"Spectrum and reference ({nm[0]:g} to {nm[-1]:g} nm) share {count} bands;"
            f" {MIN_BANDS} are needed."
        )
    bands = np.asarray(wavelengths_nm[shared], np.float64)
    wanted = np.interp(bands, nm, np.asarray(reference.values))
    found = spectral_errors(np.asarray(spectrum[shared], np.float64)[:, None], wanted[:, None], bands)
    return Comparison(
        rmse=float(found.rmse[0]),
        angle_rad=float(found.angle_rad[0]),
        delta_e=float(found.delta_e[0]),
        scale=float(found.scale[0]),
        rmse_scaled=float(found.rmse_scaled[0]),
        delta_e_scaled=float(found.delta_e_scaled[0]),
        bands=count,
        range_nm=(float(bands[0]), float(bands[-1])),
    )
