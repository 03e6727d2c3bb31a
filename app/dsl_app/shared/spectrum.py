"""The spectrum of a pixel as something to draw, and values as text."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsl_core.io.result.result_arrays import ResultArrays
from dsl_core.model.figure import with_std
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


def number_with_std(value: float, std: float, decimals: int) -> str:
    """A number and its deviation with at most so many decimals; a dash for what is not known.

    >>> number_with_std(-0.4, 0.012, 3), number_with_std(702.5, 0.004, 2), number_with_std(702.5, np.nan, 2)
    ('−0.400 ± 0.012', '702.50 ± 0.01', '702.50 ± –')
    """
    if np.isfinite(value) and np.isfinite(std) and std > 0:
        return with_std(value, std, decimals).replace("-", "−")
    return f"{number_text(value, decimals)} ± {number_text(std, decimals)}"
