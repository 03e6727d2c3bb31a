"""Spectra of Spectra Vista (SVC) instruments: ``.sig``, text with reference, target and reflectance."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from dsl_core.errors import CalibrationError
from dsl_core.io.spectra.records import Floats, Format, Quantity, Spectrum, content_of, rising
from dsl_core.io.spectra.text import Table, decoded, tables_of

#: The instrument's radiance is in 1e-10 W/(cm2 nm sr).
_TO_RADIANCE = 1e-6
_UNITS = re.compile(r"^units\s*=[^,\n]*,([^,\n]*)", re.MULTILINE | re.IGNORECASE)


def read_sig(path: Path) -> list[Spectrum]:
    """Reflectance and the light of the target; raises `CalibrationError`."""
    tables = tables_of(path, decoded(content_of(path)))
    if not tables or tables[0].cells.shape[1] < 3:
        raise CalibrationError(
            f"{path.name} has no table of wavelength, reference and target, as SVC files have. Copy it again."
        )
    table = tables[0]
    kept = _first_detector(table.cells[:, 0])
    nm, columns = table.cells[kept, 0], table.cells[kept, 1:4].T
    nm, _ = rising(path, nm, nm)
    spectra = [_light("target", nm, columns[1], _kind(table))]
    if len(columns) > 2:
        spectra.insert(0, Spectrum("reflectance", nm, columns[2] / 100.0, "reflectance", True))
    return spectra


def _first_detector(nm: Floats) -> np.ndarray:
    """Rows without those of a next detector that repeat wavelengths of the one before it."""
    before = np.maximum.accumulate(np.concatenate([[-np.inf], nm[:-1]]))
    return np.asarray(nm > before)


def _kind(table: Table) -> Quantity:
    """What was measured of the target; the first unit is that of the reference."""
    found = _UNITS.search(table.header)
    if found is None:
        return "unstated"
    word = found[1].strip().lower()
    return "radiance" if word == "radiance" else "irradiance" if "irrad" in word else "counts"


def _light(name: str, nm: Floats, values: Floats, kind: Quantity) -> Spectrum:
    if kind == "radiance":
        return Spectrum(name, nm, values * _TO_RADIANCE, kind, True)
    return Spectrum(name, nm, values, kind)


FORMAT = Format(
    "SVC", (".sig",), lambda path, head: head.lstrip().startswith(b"/*** Spectra Vista"), read_sig
)
