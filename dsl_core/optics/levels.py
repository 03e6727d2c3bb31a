"""Contrast of pictures: which values become black and white, and any three bands as red, green and blue."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsl_core.errors import StoreError

#: The values that become black and white, or the first and last colour of a scale; the first is lower.
Levels = tuple[float, float]
#: Indices of the bands that become red, green and blue.
Bands = tuple[int, int, int]
#: Values that differ by less than this share of themselves are one value, whose levels are that far from it.
LEAST_SPREAD, ROOM = 1e-6, 5e-4
#: Centres of the bands that look most like what eyes see, nm.
NATURAL_NM = (650.0, 550.0, 450.0)


def between(values: NDArray[np.floating[Any]], levels: Levels) -> NDArray[np.float32]:
    """Values as shares 0..1 of the way from the lower to the upper level; NaN stays NaN.

    Raises `StoreError` for levels of which the first is not below the second.
    """
    low, high = levels
    if not low < high:
        raise StoreError(
            f"The levels of a picture are {low:g} and {high:g}; the first must be below the second."
            " Exchange them or leave them out."
        )
    shares = np.asarray(values, np.float32) - np.float32(low)
    shares *= np.float32(1 / (high - low))
    return shares.clip(0, 1, out=shares)


def three_bands(reflectance: NDArray[np.floating[Any]], bands: Bands, levels: Levels) -> NDArray[np.float32]:
    """Three bands of a cube (bands, rows, columns) as red, green and blue (3, rows, columns), 0..1.

    All three have the same levels, so that what reflects evenly is grey.
    """
    return np.stack([between(reflectance[band], levels) for band in bands])


def natural_bands(wavelengths_nm: NDArray[np.float64]) -> Bands:
    """The bands nearest to red, green and blue light.

    >>> natural_bands(np.arange(430.0, 661.0, 10.0))
    (22, 12, 2)
    """
    red, green, blue = (int(np.abs(wavelengths_nm - nm).argmin()) for nm in NATURAL_NM)
    return red, green, blue


def rgba_of_colours(rgb: NDArray[np.float32]) -> NDArray[np.uint8]:
    """RGBA bytes (rows, columns, 4) of colours (3, rows, columns), 0..1; transparent where they are NaN."""
    picture = np.empty((*rgb.shape[1:], 4), np.uint8)
    for channel in range(3):
        level = np.nan_to_num(rgb[channel]).clip(0, 1)
        picture[..., channel] = (level * 255 + 0.5).astype(np.uint8)
    picture[..., 3] = np.where(np.isfinite(rgb[0]), 255, 0)
    return picture


def spread_of(values: NDArray[np.floating[Any]], low: float = 0.5, high: float = 99.5) -> tuple[float, float]:
    """Levels that hold nearly all values, from a thinned copy; around a value that all share.

    >>> spread_of(np.full((4, 4), 700.0))
    (699.65, 700.35)
    """
    found = _quantiles(values, low, high)
    if found is None:
        return 0.0, 1.0
    bottom, top = found
    if top - bottom > LEAST_SPREAD * max(abs(bottom), 1.0):
        return bottom, top
    # Levels so close would leave no room for the figures of a scale.
    half = ROOM * abs(bottom) if abs(bottom) > LEAST_SPREAD else 1.0
    return (max(bottom - half, 0.0) if bottom >= 0 else bottom - half), bottom + half


def top_of(cube: NDArray[np.floating[Any]]) -> float:
    """The upper level for all bands of a cube (bands, rows, columns) alike; zero is the lower one."""
    found = _quantiles(cube[:: max(len(cube) // 6, 1)], 0.5, 99.5)
    return 1.0 if found is None else max(found[1], LEAST_SPREAD)


def _quantiles(values: NDArray[np.floating[Any]], low: float, high: float) -> tuple[float, float] | None:
    """Percentiles of the known values of a thinned copy; None where nothing is known."""
    step = max(values.shape[-1] // 200, 1)
    known = values[..., ::step, ::step]
    known = known[np.isfinite(known)]
    if known.size == 0:
        return None
    bottom, top = (float(value) for value in np.percentile(known, (low, high)))
    return bottom, top
