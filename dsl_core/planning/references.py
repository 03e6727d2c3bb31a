"""Reflectances that a prediction is made for."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsl_core.optics.charts import chart_reflectance

Floats = NDArray[np.float64]
#: Wavelengths of all references, nm: the range of the projector's light.
FINE_NM: Floats = np.arange(400.0, 701.0)
FINE_NM.setflags(write=False)
#: Width and height of the narrow bands whose measured width states the resolution.
PEAK_FWHM_NM, PEAK_HEIGHT, PEAK_FLOOR = 10.0, 0.8, 0.0


@dataclass(frozen=True)
class References:
    """Spectra on `FINE_NM`, shape (spectra, wavelengths), with their names."""

    names: tuple[str, ...]
    spectra: Floats

    def at(self, wavelengths_nm: Floats) -> Floats:
        """Reflectance at other wavelengths (nm), linear between samples, (spectra, bands)."""
        return np.stack([np.interp(wavelengths_nm, FINE_NM, row) for row in self.spectra])


def chart(name: str = "BabelColor Average") -> References:
    """The patches of a classic colour chart."""
    patches = chart_reflectance(FINE_NM, name)
    return References(tuple(patches), np.stack(list(patches.values())))


def peaks(centres_nm: tuple[float, ...] = (475.0, 525.0, 575.0, 625.0)) -> References:
    """Band-pass filters of 10 nm: the maximally flat response of three coupled cavities."""
    rows = [
        PEAK_FLOOR + PEAK_HEIGHT / (1 + (2 * np.abs(FINE_NM - centre) / PEAK_FWHM_NM) ** 6)
        for centre in centres_nm
    ]
    return References(tuple(f"{centre:g} nm" for centre in centres_nm), np.stack(rows))
