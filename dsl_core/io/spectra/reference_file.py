"""Spectra to compare with: text of a spectroradiometer, an ENVI library, a table of this program."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from dsl_core.errors import CalibrationError
from dsl_core.io.reading import read_bounded
from dsl_core.io.spectra.envi_library import read_library
from dsl_core.io.spectra.spectrum_file import read_spectrum
from dsl_core.model.spectral import SpectralCurve

Floats = NDArray[np.float64]
#: The first column of a table of this program, and how a column of reflectance is called behind its name.
WAVELENGTH, MEAN = "wavelength_nm", ": reflectance (1)"
LIBRARY_SUFFIXES = (".sli", ".hdr")
#: Fewer values make no spectrum.
MIN_VALUES = 2
#: Of what was deleted in the midst of a spectrum, so much is bridged by a straight line.
MOST_BRIDGED_NM = 20.0
VISIBLE_NM = 380.0, 780.0


@dataclass(frozen=True)
class Reference:
    """A spectrum with the name that it has in its file; the only one of a text file has none."""

    name: str
    curve: SpectralCurve


@dataclass(frozen=True)
class ReferenceFile:
    """The spectra of a file, and the names of those without values."""

    references: tuple[Reference, ...]
    empty: tuple[str, ...] = ()


def read_references(path: Path) -> ReferenceFile:
    """All spectra of a file, whatever range they cover; raises `CalibrationError`."""
    if path.suffix.lower() in LIBRARY_SUFFIXES:
        nm, names, values = read_library(path)
        return _gathered(path, names, [(nm, _without_gaps(nm, each)) for each in values])
    if _is_table(path):
        return _read_table(path)
    curve = read_spectrum(path, covers_nm=(float("inf"), float("-inf")), radiance=False)
    return ReferenceFile((Reference("", curve),))


def read_reference(path: Path, name: str = "") -> SpectralCurve:
    """One spectrum of a file, by its name where there are several; raises `CalibrationError`."""
    found = read_references(path).references
    for reference in found:
        if name in (reference.name, "") and (name or len(found) == 1):
            return reference.curve
    raise CalibrationError(f"{path.name} contains no spectrum {name!r}. Add the reference again.")


def _is_table(path: Path) -> bool:
    """Whether this program wrote a table; only its names tell spectra from their deviations."""
    try:
        head = next(iter(_lines(path)), "")
    except OSError:
        return False
    return head.startswith(f"{WAVELENGTH},") and MEAN in head


def _lines(path: Path) -> list[str]:
    """The lines of a table without what it says of itself; raises `OSError`."""
    text = read_bounded(path).decode("utf-8-sig", errors="replace")
    return [line for line in text.splitlines(keepends=True) if not line.startswith("#")]


def _read_table(path: Path) -> ReferenceFile:
    try:
        head, *rows = csv.reader(_lines(path))
        cells = np.array([[float(cell or "nan") for cell in row] for row in rows]).reshape(-1, len(head))
    except (ValueError, csv.Error) as error:
        raise CalibrationError(
            f"{path.name}: a cell is not a number ({error}). Export the table again."
        ) from error
    columns = [i for i, title in enumerate(head) if title.endswith(MEAN)]
    names = [head[i].removesuffix(MEAN) for i in columns]
    return _gathered(path, names, [(cells[:, 0], cells[:, i]) for i in columns])


def _without_gaps(nm: Floats, values: Floats) -> Floats:
    """A spectrum without what is beyond a gap, seen from the side that holds more of the visible range.

    What was deleted from a library is not made up by a straight line across it.
    """
    known = np.flatnonzero(np.isfinite(values))
    gaps = np.flatnonzero((np.diff(known) > 1) & (np.diff(nm[known]) > MOST_BRIDGED_NM))
    runs = np.split(known, gaps + 1)
    low, high = VISIBLE_NM
    best = max(runs, key=lambda run: (np.count_nonzero((nm[run] >= low) & (nm[run] <= high)), len(run)))
    kept = np.full_like(values, np.nan)
    kept[best] = values[best]
    return kept


def _gathered(path: Path, names: list[str], spectra: list[tuple[Floats, Floats]]) -> ReferenceFile:
    found: dict[str, SpectralCurve] = {}
    empty = []
    for place, (name, (nm, values)) in enumerate(zip(names, spectra, strict=True), 1):
        known = np.isfinite(values)
        if np.count_nonzero(known) < MIN_VALUES:
            empty.append(name)
        elif np.any(np.diff(nm[known]) <= 0):
            raise CalibrationError(f"{path.name}: the wavelengths do not rise. Export the table again.")
        else:
            # Names bring a reference back with its result, so each must be one of a kind.
            own = name if name not in found else f"{name} ({place})"
            found[own] = SpectralCurve.of(nm[known], values[known])
    if not found:
        raise CalibrationError(f"No spectrum of {path.name} contains values. Choose another file.")
    return ReferenceFile(tuple(Reference(name, curve) for name, curve in found.items()), tuple(empty))
