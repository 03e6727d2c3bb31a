"""Spectra of Spectral Evolution instruments (PSR, RS, SR): ``.sed``, text with columns behind ``Data:``."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

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
    """Every column but those of the white reference; raises `CalibrationError`.

    Where no column is reflectance, it is the target's light divided by that of the white.
    """
    text = decoded(content_of(path))
    said = _UNITS.search(text)
    factor = quantity_of(said[1])[1] if said else 1.0
    spectra = []
    for table in tables_of(path, text):
        found = spectra_of(path, table)
        spectra += _shares(found)
        for spectrum in found:
            if _is_white(spectrum):
                continue
            if spectrum.quantity == "radiance" and not spectrum.scaled:
                # Without a line of units, the instruments write W/(m2 sr nm).
                spectrum = replace(spectrum, values=spectrum.values * factor, scaled=True)
            spectra.append(spectrum)
    if not spectra:
        raise CalibrationError(f"{path.name} has no spectrum behind its line 'Data:'. Copy it again.")
    return spectra


def _is_white(spectrum: Spectrum) -> bool:
    return "(ref.)" in spectrum.name.lower()


def _shares(found: Sequence[Spectrum]) -> list[Spectrum]:
    """Reflectance by the first white and target of a table, NaN without light; none where it has its own."""
    white = next((each for each in found if _is_white(each)), None)
    target = next((each for each in found if "(target)" in each.name.lower()), None)
    if white is None or target is None or any(each.quantity == "reflectance" for each in found):
        return []
    values = np.full(target.values.shape, np.nan)
    np.divide(target.values, white.values, out=values, where=white.values > 0)
    return [Spectrum("reflectance", target.nm, values, "reflectance", True)]


FORMAT = Format("Spectral Evolution", (".sed",), is_sed, read_sed)
