"""Text of hand-held light meters (Sekonic, UPRtek): a line for each wavelength, which its label contains."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from dsl_core.errors import CalibrationError
from dsl_core.io.spectra.records import Format, Spectrum, content_of, rising
from dsl_core.io.spectra.text import MIN_ROWS, cells_of, decoded, is_text, number_of

#: "Spectral Data 380[nm]" and "380nm", alone in the first cell of a line.
_LABEL = re.compile(r"(?:[A-Za-z ]*[A-Za-z] )?(\d{3,4}(?:\.\d+)?) ?\[?nm\]?")


def is_light_meter(path: Path, head: bytes) -> bool:
    """Whether enough lines begin with a wavelength's label."""
    return is_text(head) and max(map(len, _tables(decoded(head))), default=0) >= MIN_ROWS


def read_light_meter(path: Path) -> list[Spectrum]:
    """The finest of the file's tables, as irradiance in the instrument's unit; raises `CalibrationError`."""
    finest = max(_tables(decoded(content_of(path))), key=len, default=[])
    if len(finest) < MIN_ROWS:
        raise CalibrationError(
            f"{path.name} has {len(finest)} lines with a wavelength and a value; {MIN_ROWS} or more are"
            " needed. Export the spectrum again."
        )
    nm, values = rising(path, *np.array(finest).T)
    return [Spectrum("", nm, values, "irradiance")]


def _tables(text: str) -> list[list[tuple[float, float]]]:
    """Wavelengths (nm) and values of lines that follow each other; a new table begins where they fall."""
    tables: list[list[tuple[float, float]]] = []
    last = np.inf
    for line in text.splitlines():
        cells = cells_of(line)
        label = _LABEL.fullmatch(cells[0]) if len(cells) == 2 else None
        if label is None or not np.isfinite(value := number_of(cells[1])):
            continue
        nm = float(label[1])
        if nm <= last:
            tables.append([])
        tables[-1].append((nm, value))
        last = nm
    return tables


FORMAT = Format("Sekonic, UPRtek", (".csv", ".xls", ".txt"), is_light_meter, read_light_meter)
