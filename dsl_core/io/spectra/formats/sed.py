"""Spectra of Spectral Evolution instruments (PSR, RS, SR): ``.sed``, text with columns behind ``Data:``."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

from dsl_core.errors import CalibrationError
from dsl_core.io.spectra.formats.columns import spectra_of
from dsl_core.io.spectra.records import Format, Spectrum, content_of
from dsl_core.io.spectra.text import decoded, tables_of
from dsl_core.io.spectra.units import quantity_of

_UNITS = re.compile(r"^Units\s*:\s*([^\n]*W[^\n]*)$", re.MULTILINE | re.IGNORECASE)
_HEADS = (b"Wvl", b"Chan.#")


def is_sed(path: Path, head: bytes) -> bool:
    """Whether a text has a line ``Data:`` with the columns' names below it."""
    parts = re.split(rb"\nData:[^\n]*\n", head, maxsplit=1)
    return len(parts) == 2 and parts[1].startswith(_HEADS)


def read_sed(path: Path) -> list[Spectrum]:
    """Every column but those of the white reference; raises `CalibrationError`."""
    text = decoded(content_of(path))
    said = _UNITS.search(text)
    factor = quantity_of(said[1])[1] if said else 1.0
    spectra = []
    for table in tables_of(path, text):
        for spectrum in spectra_of(path, table):
            if "(ref.)" in spectrum.name.lower():
                continue
            if spectrum.quantity == "radiance":
                # Without a line of units, the instruments write W/(m2 sr nm).
                spectrum = replace(spectrum, values=spectrum.values * factor, scaled=True)
            spectra.append(spectrum)
    if not spectra:
        raise CalibrationError(f"{path.name} has no spectrum behind its line 'Data:'. Copy it again.")
    return spectra


FORMAT = Format("Spectral Evolution", (".sed",), is_sed, read_sed)
