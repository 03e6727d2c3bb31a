"""Spreadsheets: recognised, so that they are refused with the way out rather than as damaged text."""

from __future__ import annotations

from pathlib import Path

from dsl_core.errors import CalibrationError
from dsl_core.io.spectra.records import Format, Spectrum

_OLD, _ZIP = b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1", b"PK\x03\x04"


def refuse(path: Path) -> list[Spectrum]:
    """Raise `CalibrationError` with what to do."""
    raise CalibrationError(
        f"{path.name} is a spreadsheet or an archive. Save the sheet with the spectrum as CSV and choose"
        " that file."
    )


FORMAT = Format(
    "spreadsheet",
    (),
    lambda path, head: head.startswith((_OLD, _ZIP)),
    refuse,
)
