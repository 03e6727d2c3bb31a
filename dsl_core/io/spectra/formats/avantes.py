"""Text of AvaSoft: sample, dark and reference in counts, and what was made of them in the last column."""

from __future__ import annotations

import re
from pathlib import Path

from dsl_core.errors import CalibrationError
from dsl_core.io.spectra.formats.columns import spectra_of
from dsl_core.io.spectra.records import Format, Quantity, Spectrum, content_of
from dsl_core.io.spectra.text import decoded, tables_of

_RAW = re.compile(r"sample|dark|reference|scope", re.IGNORECASE)


def read_avantes(path: Path) -> list[Spectrum]:
    """Every column, those of raw counts as such; raises `CalibrationError`."""
    tables = tables_of(path, decoded(content_of(path)))
    spectra = [s for table in tables for s in spectra_of(path, table, known=_raw)]
    if not spectra:
        raise CalibrationError(f"{path.name} has no spectrum behind its header. Export it again.")
    return spectra


def _raw(title: str) -> Quantity | None:
    return "counts" if _RAW.match(title) else None


FORMAT = Format(
    "Avantes",
    (".txt", ".ttx", ".trt"),
    lambda path, head: b"Data measured with spectrometer" in head[:4096],
    read_avantes,
)
