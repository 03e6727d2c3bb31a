"""Text with wavelengths in a column or in a line, whatever surrounds it: the format of last resort."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np

from dsl_core.errors import CalibrationError
from dsl_core.io.spectra.records import WAVELENGTHS_NM, Format, Quantity, Spectrum, content_of, rising
from dsl_core.io.spectra.text import MIN_ROWS, Table, cells_of, decoded, is_text, number_of, tables_of
from dsl_core.io.spectra.units import counts_rows, is_beside, quantity_of, to_nanometres

#: Corrects what a format knows better than its titles say: column's title to quantity.
Known = Callable[[str], Quantity | None]
_WAVELENGTH = re.compile(r"wave ?l|wvl|\bwave\b|wellenl|lambda|λ|^\W?(?:nm|um|µm|μm)\W?$", re.IGNORECASE)
#: Lines in which the wavelengths of a table of lines are looked for.
MOST_HEADER = 300
_LABEL = re.compile(r"(?:[A-Za-z]{1,12}[_ ]?)?(\d{3,5}(?:\.\d+)?)(?: ?nm)?", re.IGNORECASE)


def read_columns(path: Path) -> list[Spectrum]:
    """Every spectrum in a text; raises `CalibrationError`."""
    text = decoded(content_of(path))
    found = _in_lines(path, text) or [s for table in tables_of(path, text) for s in spectra_of(path, table)]
    if not found:
        raise CalibrationError(
            f"{path.name} contains no table of wavelengths and values. Export the spectrum as text in"
            " two columns."
        )
    return found


def spectra_of(path: Path, table: Table, known: Known | None = None) -> list[Spectrum]:
    """The spectra of a table with wavelengths in one of its columns; raises `CalibrationError`."""
    titles, names = table.titles, table.names
    columns = list(range(table.cells.shape[1]))
    if len(columns) > 2:
        columns = [i for i in columns if not counts_rows(titles[i], table.cells[:, i])] or columns
    first = next((i for i in columns if _WAVELENGTH.search(titles[i])), columns[0])
    given = table.cells[:, first]
    kept = np.isfinite(given)
    if np.count_nonzero(kept) < MIN_ROWS:
        return []
    nm = to_nanometres(path, given[kept], titles[first], table.header)
    values_of = [i for i in columns if i != first and not is_beside(titles[i])]
    spectra = []
    for i in values_of:
        values = table.cells[kept, i]
        if np.isfinite(values).any():
            # What the whole header says is of one column only where it is the only one.
            around = "" if len(values_of) > 1 else table.above
            around = around if titles[i] else table.header
            spectra.append(_spectrum(path, names[i], titles[i], around, nm, values, known))
    return spectra


def _spectrum(
    path: Path, name: str, title: str, around: str, nm: np.ndarray, values: np.ndarray, known: Known | None
) -> Spectrum:
    nm, values = rising(path, nm, values)
    own = known(title) if known is not None else None
    if own is not None:
        return Spectrum(name, nm, values, own)
    quantity, factor, is_scaled = quantity_of(title, around)
    return Spectrum(name, nm, values * factor, quantity, is_scaled)


def _in_lines(path: Path, text: str) -> list[Spectrum]:
    """Spectra of a text whose wavelengths stand over its columns, one spectrum a line."""
    lines = text.splitlines()
    for at, line in enumerate(lines[:MOST_HEADER]):
        cells = cells_of(line)
        labels = [_LABEL.fullmatch(cell) for cell in cells]
        start = next((i for i in range(len(labels)) if all(labels[i:])), len(labels))
        if start == 0 or len(cells) - start < MIN_ROWS:
            continue
        nm = np.array([float(label[1]) for label in labels[start:] if label])
        if nm[0] < WAVELENGTHS_NM[0] or np.any(np.diff(nm) <= 0):
            continue
        header = "\n".join([*lines[:at], " ".join(cells[:start])])
        return [s for row in lines[at + 1 :] for s in _line(path, row, start, nm, header)]
    return []


def _line(path: Path, row: str, start: int, nm: np.ndarray, header: str) -> list[Spectrum]:
    cells = cells_of(row)
    values = np.array([number_of(cell) for cell in cells[start:]])
    if len(cells) <= start or len(values) > len(nm) or np.count_nonzero(np.isfinite(values)) < MIN_ROWS:
        return []
    values = np.concatenate([values, np.full(len(nm) - len(values), np.nan)])
    name = next((cell for cell in cells[:start] if cell), "")
    return [_spectrum(path, name, " ".join(cells[:start]), header, nm, values, None)]


FORMAT = Format(
    "text or CSV",
    (".csv", ".txt", ".tsv", ".dat", ".asc"),
    lambda path, head: is_text(head),
    read_columns,
)
