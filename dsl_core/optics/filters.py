"""Bandpass filters in front of the camera."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.rig import Rig
from dsl_core.model.spectral import SpectralCurve
from dsl_core.optics.spectra import chain_response

Floats = NDArray[np.float64]

#: Wavelengths on which integrals over a filter are taken.
FINE_NM = np.arange(390.0, 711.0)


def nominal_filter(centre_nm: float, fwhm_nm: float = 10.0, peak: float = 0.8) -> SpectralCurve:
    """Transmission that a data sheet promises: three coupled cavities, ``peak / (1 + (2 d / fwhm)^6)``."""
    nm = np.arange(centre_nm - 60.0, centre_nm + 60.5, 0.5)
    return SpectralCurve.of(nm, peak / (1 + (2 * np.abs(nm - centre_nm) / fwhm_nm) ** 6))


def passed(rig: Rig, transmission: SpectralCurve) -> Floats:
    """Zero-order signal through a filter per nm at `FINE_NM`, white light, DN per ms, (3, wavelengths)."""
    through = np.interp(FINE_NM, transmission.wavelengths_nm, transmission.values, 0.0, 0.0)
    return np.asarray(chain_response(rig, 0, FINE_NM).sum(1) * through)
