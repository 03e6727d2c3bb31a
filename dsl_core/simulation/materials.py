"""Reflectance spectra of the twin's scenes, on the fine grid 400 to 700 nm, Spectralon scale."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from dsl_core.optics.colour import colour_library
from dsl_core.simulation.truth import FINE_NM

Spectrum = NDArray[np.float64]

#: Nearly perfect diffuser: Spectralon reflects 99 % over the visible range (Labsphere's data sheet).
SPECTRALON = 0.99
#: Anodised or flocked surfaces that surround a target.
DARK = 0.03


def flat(reflectance: float) -> Spectrum:
    """The same reflectance at every wavelength."""
    return np.full(FINE_NM.shape, float(reflectance))


@cache
def chart_spectra(name: str = "BabelColor Average") -> dict[str, Spectrum]:
    """The 24 patches of a classic chart, in reading order, by the name of their colour-science data set.

    "BabelColor Average" (30 charts, 10 nm) and "ISO 17321-1" (5 nm) cover 400 to 700 nm; between samples
    the monotone cubic of Fritsch and Carlson adds no overshoot.
    """
    from scipy.interpolate import PchipInterpolator

    patches = colour_library().SDS_COLOURCHECKERS[name]
    return {
        patch: np.clip(PchipInterpolator(sd.wavelengths, sd.values)(FINE_NM), 0.0, 1.0)
        for patch, sd in patches.items()
    }
