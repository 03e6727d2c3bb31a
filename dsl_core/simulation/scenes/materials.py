"""Reflectance spectra of the twin's scenes, on the fine grid 400 to 700 nm, Spectralon scale."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from dsl_core.optics.charts import chart_reflectance
from dsl_core.optics.colour import observer_weights
from dsl_core.optics.filters import three_cavities
from dsl_core.resources import resource_path
from dsl_core.simulation.scenes.truth import FINE_NM

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
    """The 24 patches of a classic chart on the fine grid, by name, in reading order."""
    return chart_reflectance(FINE_NM, name)


def bandpass(centre_nm: float, fwhm_nm: float = 10.0) -> Spectrum:
    """A bandpass filter used as a reflector: half the peak is reached at plus and minus half the FWHM."""
    return three_cavities(FINE_NM - centre_nm, fwhm_nm)


def _bump(centre_nm: float, width_nm: float, height: float) -> Spectrum:
    """A Gaussian of standard deviation ``width_nm``."""
    return height * np.exp(-0.5 * ((FINE_NM - centre_nm) / width_nm) ** 2)


def _rise(centre_nm: float, width_nm: float) -> Spectrum:
    """A step from 0 to 1, the typical edge of a pigment."""
    return 1.0 / (1.0 + np.exp(-(FINE_NM - centre_nm) / width_nm))


def pigment(low: float, high: float, edge_nm: float, width_nm: float = 15.0) -> Spectrum:
    """A pigment that reflects ``low`` below an edge and ``high`` above it (yellow, orange, red, ...)."""
    return low + (high - low) * _rise(edge_nm, width_nm)


def ceramic_blue() -> Spectrum:
    """A blue glaze: one broad band with a little red."""
    return 0.06 + _bump(460.0, 35.0, 0.45) + _bump(700.0, 25.0, 0.2)


def green() -> Spectrum:
    """A green paint."""
    return 0.06 + _bump(530.0, 32.0, 0.5)


def leaf() -> Spectrum:
    """A living leaf: chlorophyll a and b and carotenoids leave a green peak and a red edge.

    Absorption bands near 435, 470, 645 and 675 nm (Lichtenthaler 1987), heights set to the usual 5 % in the
    blue and red, 18 % at 550 nm and a steep rise from 690 nm.
    """
    absorbance = 0.42 + _bump(425.0, 45.0, 0.50) + _bump(475.0, 25.0, 0.40) + _bump(620.0, 35.0, 0.28)
    absorbance = absorbance + _bump(675.0, 14.0, 0.65) - 0.25 * _rise(695.0, 5.0)
    return 0.5 * 10.0**-absorbance + 0.012


def dyed_leaf() -> Spectrum:
    """A plastic leaf with the colour of `leaf` under D65 for the CIE 1931 observer, and another spectrum.

    Three dye bands on a dark base, whose heights solve for equal X, Y, Z.
    """
    weights = observer_weights(FINE_NM)
    base = flat(0.012)
    dyes = np.stack([_bump(470.0, 36.0, 1.0), _bump(525.0, 18.0, 1.0), _bump(590.0, 18.0, 1.0)])
    heights = np.linalg.solve(weights @ dyes.T, weights @ (leaf() - base))
    return np.asarray(base + heights @ dyes)


def skin(blood: float = 0.004, melanin: float = 0.02) -> Spectrum:
    """Human skin for volume fractions of blood in the dermis and of melanosomes in the epidermis.

    Dermis: diffuse reflectance ``exp(-A / sqrt(3 (1 + mu_s' / mu_a)))`` with A = 7; what is not blood
    absorbs 0.2 per cm. Epidermis: 0.06 mm, passed twice.
    Formulas and constants after S. L. Jacques, "Optical properties of biological tissues: a review",
    Phys. Med. Biol. 58 (2013): 150 g/l haemoglobin of 64,500 g/mol, ``mu_mel = 519 (nm/500)^-3`` per cm,
    ``mu_s' = 46 (nm/500)^-1.4`` per cm.
    """
    from scipy.interpolate import PchipInterpolator

    nm, extinction = np.loadtxt(resource_path("colour/oxyhaemoglobin.csv"), delimiter=",", unpack=True)
    haemoglobin = np.exp(PchipInterpolator(nm, np.log(extinction))(FINE_NM))
    scattering = 46.0 * (FINE_NM / 500.0) ** -1.4
    absorption = blood * haemoglobin * np.log(10.0) * 150.0 / 64500.0 + 0.2
    dermis = np.exp(-7.0 / np.sqrt(3.0 * (1.0 + scattering / absorption)))
    epidermis_cm = 0.006
    epidermis = np.exp(-2.0 * epidermis_cm * melanin * 519.0 * (FINE_NM / 500.0) ** -3.0)
    return np.asarray(dermis * epidermis)


def hair() -> Spectrum:
    """Dark brown hair: melanin, darkest in the blue."""
    return 0.03 + 0.05 * ((FINE_NM - 400.0) / 300.0) ** 2
