"""The twin's bandpass filters: true curves, which differ from the label, and what a spectrometer says."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from dsl_core.errors import DeviceError
from dsl_core.model.spectral import SpectralCurve

#: Labels of the filters, nm.
LABELS_NM = tuple(float(nm) for nm in range(430, 661, 10))
#: Deviations between filters of one maker: centre, width (nm) and peak; and the noise of a measured trace.
CENTRE_STD_NM, FWHM_STD_NM, TRACE_STD = 1.0, 0.3, 0.001
#: Effective refractive index of the layers, which sets how a tilt moves the band to the blue.
INDEX = 1.9
_NM = np.arange(390.0, 711.0, 0.5)


@lru_cache(maxsize=256)
def true_transmission(
    label_nm: float, seed: int = 0, tilt_deg: float = 0.0, off_nm: float = 0.0
) -> SpectralCurve:
    """Transmission of a filter in the beam: three cavities, to the blue by a tilt, to the red by ``off_nm``.

    ``centre sqrt(1 - (sin tilt / index)^2)`` (Macleod, Thin-Film Optical Filters). Raises `DeviceError` for a
    label that the set does not have.
    """
    if label_nm not in LABELS_NM:
        raise DeviceError(
            f"The twin has bandpass filters every 10 nm from {LABELS_NM[0]:g} to {LABELS_NM[-1]:g} nm,"
            f" none of {label_nm:g} nm."
        )
    rng = np.random.default_rng([seed, round(label_nm)])
    centre = label_nm + CENTRE_STD_NM * rng.standard_normal()
    fwhm = 10.0 + FWHM_STD_NM * rng.standard_normal()
    peak = rng.uniform(0.72, 0.88)
    centre += off_nm
    centre *= np.sqrt(1 - (np.sin(np.radians(tilt_deg)) / INDEX) ** 2)
    return SpectralCurve.of(_NM, peak / (1 + (2 * np.abs(_NM - centre) / fwhm) ** 6))


def measured_transmissions(seed: int = 0) -> dict[float, SpectralCurve]:
    """What a spectrometer says of every filter, by label."""
    return {label: _trace(true_transmission(label, seed), label, seed) for label in LABELS_NM}


def _trace(curve: SpectralCurve, label_nm: float, seed: int) -> SpectralCurve:
    rng = np.random.default_rng([seed, round(label_nm), 1])
    values: NDArray[np.float64] = np.array(curve.values)
    noisy = values + TRACE_STD * rng.standard_normal(values.shape)
    # Away from the band a trace is noise about zero, which no data sheet prints.
    near = values > 1e-3
    return SpectralCurve.of(curve.wavelengths_nm, np.where(near, noisy.clip(min=0), 0.0))
