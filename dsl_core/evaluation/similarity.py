"""Where in an image a spectrum occurs, and where only its colour does."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsl_core.errors import DecodeError
from dsl_core.optics.colour import delta_e_2000, hold_colour, reflectance_to_lab
from dsl_core.progress import NoProgress, Progress

Floats = NDArray[np.float32] | NDArray[np.float64]
Map = NDArray[np.float32]
#: Rows taken at once, so that intermediates stay small compared with the cube.
BLOCK_ROWS = 64


def angle_map(cube: Floats, spectrum: Floats) -> Map:
    """Spectral angle (rad) between each pixel of (bands, rows, columns) and a spectrum (bands,).

    The angle does not depend on scale, so shading and gloss hardly matter (F. A. Kruse et al., "The spectral
    image processing system", Remote Sens. Environ. 44, 1993). NaN where a pixel has no spectrum. Raises
    `DecodeError` for a spectrum that is not finite, is zero, or has other bands.
    """
    wanted = np.asarray(spectrum, np.float32)
    if wanted.shape != (len(cube),) or not np.isfinite(wanted).all() or not wanted.any():
        raise DecodeError(
            f"A spectrum of {wanted.size} bands cannot be searched for in {len(cube)} bands, or it has no"
            " finite values. Choose a pixel or region with a complete spectrum."
        )
    product = np.tensordot(wanted / np.linalg.norm(wanted), cube, axes=1)
    power = np.einsum("b...,b...->...", cube, cube)
    cosine = product / np.sqrt(np.maximum(power, np.float32(1e-20)))
    return np.asarray(np.arccos(np.clip(cosine, -1, 1)), np.float32)


def colour_difference_map(
    cube: Floats, spectrum: Floats, wavelengths_nm: NDArray[np.float64], progress: Progress | None = None
) -> Map:
    """CIEDE2000 under D65 between each pixel of (bands, rows, columns) and a spectrum (bands,).

    NaN where a pixel has no spectrum, and everywhere if the bands hold too little of a colour.
    """
    if not hold_colour(wavelengths_nm):
        return np.full(cube.shape[1:], np.nan, np.float32)
    progress = progress or NoProgress()
    lab = reflectance_to_lab(np.asarray(spectrum, np.float64)[:, None, None], wavelengths_nm)
    out = np.empty(cube.shape[1:], np.float32)
    for start in range(0, len(out), BLOCK_ROWS):
        progress.report("colour differences", start, len(out))
        rows = slice(start, start + BLOCK_ROWS)
        out[rows] = delta_e_2000(reflectance_to_lab(cube[:, rows], wavelengths_nm), lab)
    return out


@dataclass(frozen=True)
class Likeness:
    """How like a spectrum each pixel is: in colour (CIEDE2000 under D65) and in spectrum (angle, rad)."""

    delta_e: Map
    angle_rad: Map

    def same_spectrum(self, within_rad: float) -> NDArray[np.bool_]:
        """Pixels whose spectrum has the same shape."""
        return self.angle_rad <= within_rad

    def metamers(self, within_delta_e: float, beyond_rad: float) -> NDArray[np.bool_]:
        """Pixels that look the same under D65, yet have another spectrum."""
        return (self.delta_e <= within_delta_e) & (self.angle_rad > beyond_rad)


def likeness(
    cube: Floats, spectrum: Floats, wavelengths_nm: NDArray[np.float64], progress: Progress | None = None
) -> Likeness:
    """Compare each pixel of (bands, rows, columns) with a spectrum (bands,); raises `DecodeError`."""
    angles = angle_map(cube, spectrum)
    return Likeness(colour_difference_map(cube, spectrum, wavelengths_nm, progress), angles)


def angle_noise(cube: Floats, std: Floats) -> Map:
    """The angle (rad) that the deviations of each pixel make alone; cubes of (bands, rows, columns)."""
    noise, length = (
        np.sqrt(np.sum([np.nan_to_num(band) ** 2 for band in each], axis=0, dtype=np.float64))
        for each in (std, cube)
    )
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.arctan2(noise, length), np.float32)
