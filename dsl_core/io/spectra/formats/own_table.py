"""Tables that this program exported: spectra with their deviations next to them."""

from __future__ import annotations

import csv
import re
from pathlib import Path

import numpy as np

from dsl_core.errors import CalibrationError
from dsl_core.io.spectra.records import Format, Spectrum, content_of
from dsl_core.io.spectra.text import decoded

#: The first column of a table of this program, and how a column of reflectance is called behind its name.
WAVELENGTH, MEAN = "wavelength_nm", ": reflectance (1)"
_HEAD = re.compile(rf"^(?:\ufeff)?{WAVELENGTH},[^\n]*{re.escape(MEAN)}", re.MULTILINE)
#: The first columns of a table of pixels, a row for each pixel and band, and what of it is a spectrum.
PIXELS, REFLECTANCE = ("x_px", "y_px"), "reflectance"
#: How this program calls a spectrum that nobody has named; alone in a file, its file's name says more.
BY_PLACE = re.compile(r"mean of \d+ pixels|x [\d.]+, y [\d.]+|spectrum")


def is_own(path: Path, head: bytes) -> bool:
    """Whether this program wrote a table; only its names tell spectra from their deviations."""
    lines = (line for line in decoded(head).splitlines() if not line.startswith("#"))
    first = next(lines, "")
    return bool(_HEAD.match(first)) or _is_of_pixels(first.lstrip("\ufeff").split(","))


def _is_of_pixels(head: list[str]) -> bool:
    return tuple(head[:2]) == PIXELS and {WAVELENGTH, REFLECTANCE} <= set(head)


def read_own(path: Path) -> list[Spectrum]:
    """Every spectrum of a table; raises `CalibrationError`."""
    lines = decoded(content_of(path)).splitlines(keepends=True)
    try:
        head, *rows = csv.reader([line for line in lines if not line.startswith("#")])
        if _is_of_pixels(head):
            return _of_pixels(path, head, rows)
        cells = np.array([[float(cell or "nan") for cell in row] for row in rows]).reshape(-1, len(head))
    except (ValueError, csv.Error) as error:
        raise CalibrationError(
            f"{path.name}: a cell is not a number ({error}). Export the table again."
        ) from error
    columns = [i for i, title in enumerate(head) if title.endswith(MEAN)]
    if np.any(~(np.diff(cells[:, 0]) > 0)):
        raise CalibrationError(f"{path.name}: the wavelengths do not rise. Export the table again.")
    return [
        Spectrum(head[i].removesuffix(MEAN), cells[:, 0], cells[:, i], "reflectance", True) for i in columns
    ]


def _of_pixels(path: Path, head: list[str], rows: list[list[str]]) -> list[Spectrum]:
    """A spectrum for each pixel of a table, named like ``x 50, y 30``; pixels without one are left out."""
    nm, value = head.index(WAVELENGTH), head.index(REFLECTANCE)
    found: dict[str, dict[float, float]] = {}
    for row in rows:
        if len(row) != len(head):
            raise CalibrationError(f"{path.name}: a row is cut off. Export the table again.")
        found.setdefault(f"x {row[0]}, y {row[1]}", {})[float(row[nm])] = float(row[value])
    spectra = []
    for name, pairs in found.items():
        bands, values = np.array(list(pairs.items())).T
        if np.isfinite(values).any():
            spectra.append(Spectrum(name, bands, values, "reflectance", True))
    return spectra


FORMAT = Format("table of dsl-scan", (".csv",), is_own, read_own, is_named=True)
