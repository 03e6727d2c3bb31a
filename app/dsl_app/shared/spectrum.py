"""The spectrum of a pixel as something to draw, and values as text."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsl_core.io.result.result_arrays import ResultArrays
from dsl_core.solve.normal import BAND_95

#: Column and row of a pixel.
Pixel = tuple[int, int]
Floats = NDArray[np.floating[Any]]


@dataclass(frozen=True)
class Spectrum:
    """A curve to draw, all of shape (bands,): value, standard deviation, and share decided by data.

    The band around it is ``sigmas`` deviations wide to either side.
    """

    nm: Floats
    mean: Floats
    std: Floats | None = None
    share: Floats | None = None
    sigmas: float = BAND_95


def spectrum_of_pixel(result: ResultArrays, pixel: Pixel) -> Spectrum | None:
    """The spectrum of a pixel of a result; None where it has none."""
    if not result.has_spectra or not result.holds(pixel):
        return None
    mean = result.at("reflectance", pixel)
    if not np.isfinite(mean).any():
        return None
    std, share = (
        result.at(name, pixel) if name in result.arrays else None
        for name in ("reflectance_std", "data_share")
    )
    return Spectrum(result.wavelengths_nm, mean, std, share)


def number_text(value: float, decimals: int) -> str:
    """A number with a typographic minus; a dash for NaN and infinity.

    >>> number_text(-1.25, 1), number_text(np.nan, 1)
    ('−1.2', '–')
    """
    return f"{value:.{decimals}f}".replace("-", "−") if np.isfinite(value) else "–"
