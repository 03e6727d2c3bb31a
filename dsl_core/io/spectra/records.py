"""What a reader of a spectral format returns, and how a format describes itself."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from dsl_core.errors import CalibrationError
from dsl_core.io.reading import read_bounded

Floats = NDArray[np.float64]
Quantity = Literal[
    "reflectance", "transmittance", "radiance", "irradiance", "counts", "absorbance", "derivative", "unstated"
]
#: What is read to recognise a format, and at most of any file.
HEAD_BYTES, MOST_BYTES = 65_536, 16 << 20
#: No instrument measures so much; -1.23e34 marks what was deleted in many libraries.
MOST_NUMBER = 1e30
#: Wavelengths beyond these are no wavelengths of light that an instrument resolves.
WAVELENGTHS_NM = 150.0, 50_000.0
VISIBLE_NM = 380.0, 780.0


@dataclass(frozen=True)
class Spectrum:
    """One spectrum of a file.

    ``nm`` rises; ``values`` are NaN where the file has none. Where ``scaled``, the file states its unit and
    the values are shares (reflectance, transmittance) or W/(sr m2 nm) (radiance); else they are as written.
    """

    name: str
    nm: Floats
    values: Floats
    quantity: Quantity = "unstated"
    scaled: bool = False


@dataclass(frozen=True)
class Format:
    """A kind of file: how to recognise it by its content, and how to read it.

    ``recognises`` gets the first `HEAD_BYTES` of the file; ``read`` returns every spectrum and raises
    `CalibrationError`. ``is_named``: the name of a spectrum says more than that of its file, even alone.
    """

    name: str
    suffixes: tuple[str, ...]
    recognises: Callable[[Path, bytes], bool]
    read: Callable[[Path], list[Spectrum]]
    is_named: bool = False


def content_of(path: Path) -> bytes:
    """All of a file that is small enough to hold spectra; raises `CalibrationError`."""
    try:
        return read_bounded(path, MOST_BYTES)
    except OSError as error:
        raise CalibrationError(
            f"The spectrum {path} cannot be read ({error.strerror or error}). Correct its path."
        ) from error


def most_of(nm: Floats, values: Floats) -> float:
    """How large a spectrum is: its largest value where light is visible, or its median where that is larger.

    At the ends of a detector instruments divide noise by noise, and a single such value says nothing of the
    scale of the others. Without two values where light is visible it is the largest of all; 0 for none.
    """
    low, high = VISIBLE_NM
    known = np.isfinite(values)
    if not known.any():
        return 0.0
    inside = known & (nm >= low) & (nm <= high)
    if np.count_nonzero(inside) < 2:
        return float(max(values[known].max(), 0.0))
    return float(max(values[inside].max(), np.median(values[known]), 0.0))


def rising(path: Path, nm: Floats, values: Floats) -> tuple[Floats, Floats]:
    """Wavelengths (nm) and values in rising order; raises `CalibrationError` where neither order holds."""
    steps = np.diff(nm)
    if len(nm) > 1 and np.all(steps < 0):
        nm, values, steps = nm[::-1], values[::-1], -steps[::-1]
    if np.any(steps <= 0):
        at = int(np.argmax(steps <= 0))
        raise CalibrationError(
            f"{path.name}: the wavelengths do not rise: {nm[at + 1]:g} comes after {nm[at]:g} nm. Export one"
            " spectrum per file, in rising order."
        )
    low, high = WAVELENGTHS_NM
    if len(nm) == 0 or not (nm[0] >= low and nm[-1] <= high):
        span = f"{nm[0]:g} to {nm[-1]:g} nm" if len(nm) else "nothing"
        raise CalibrationError(
            f"{path.name}: the wavelengths cover {span}; between {low:g} and {high:g} nm are needed. Export"
            " the spectrum over wavelength, in nanometres."
        )
    return nm, values
