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


def filters() -> References:
    """The nine filters of the twin's scene of that name, 450 to 650 nm every 25."""
    return peaks(tuple(float(nm) for nm in range(450, 651, 25)))


def unseen() -> References:
    """Twenty-four spectra that no design and no prior was made with: steps, bumps, wiggles, greys.

    Sigmoid edges, Gaussian bands, double bands and slow oscillations, drawn once; pigments, dyes and greys
    look so.
    """
    rng = np.random.Generator(np.random.PCG64(2024))
    rows, names = [], []
    x = FINE_NM
    for i in range(24):
        kind = ("edge", "band", "two bands", "wave")[i % 4]
        low, high = rng.uniform(0.03, 0.2), rng.uniform(0.4, 0.9)
        centre, width = rng.uniform(440, 650), rng.uniform(12, 45)
        if kind == "edge":
            shape = 1 / (1 + np.exp(-(x - centre) / width * rng.choice([-2, 2])))
        elif kind == "band":
            shape = np.exp(-0.5 * ((x - centre) / width) ** 2)
        elif kind == "two bands":
            other = centre + rng.choice([-1, 1]) * rng.uniform(50, 100)
            shape = np.exp(-0.5 * ((x - centre) / width) ** 2)
            shape = np.maximum(shape, rng.uniform(0.4, 1) * np.exp(-0.5 * ((x - other) / width) ** 2))
        else:
            shape = 0.5 + 0.5 * np.sin(2 * np.pi * (x - centre) / rng.uniform(60, 200))
        rows.append(low + (high - low) * shape)
        names.append(f"{kind} {i}")
    return References(tuple(names), np.stack(rows))
