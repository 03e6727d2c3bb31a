"""All formats of spectra, recognised by content: a new one is a file in ``formats/`` and a line here."""

from __future__ import annotations

from pathlib import Path

from dsl_core.errors import CalibrationError
from dsl_core.io.reading import require_plain
from dsl_core.io.spectra.formats import (
    asd,
    avantes,
    cgats,
    columns,
    envi,
    jcamp,
    konica_minolta,
    ocean,
    own_table,
    sed,
    spreadsheet,
    svc,
)
from dsl_core.io.spectra.records import HEAD_BYTES, Format, Spectrum

#: In the order in which they are tried; the last takes any text.
FORMATS: tuple[Format, ...] = (
    envi.FORMAT,
    asd.FORMAT,
    spreadsheet.FORMAT,
    own_table.FORMAT,
    svc.FORMAT,
    jcamp.FORMAT,
    cgats.FORMAT,
    sed.FORMAT,
    ocean.FORMAT,
    avantes.FORMAT,
    konica_minolta.FORMAT,
    columns.FORMAT,
)
#: Endings of files that can contain spectra, each once, for a list of files.
SUFFIXES: tuple[str, ...] = tuple(dict.fromkeys(s for each in reversed(FORMATS) for s in each.suffixes))


def format_of(path: Path) -> Format:
    """The format of a file by its content; raises `CalibrationError`."""
    try:
        require_plain(path)
        with path.open("rb") as file:
            head = file.read(HEAD_BYTES)
    except OSError as error:
        raise CalibrationError(
            f"The spectrum {path} cannot be read ({error.strerror or error}). Correct its path."
        ) from error
    for each in FORMATS:
        if each.recognises(path, head):
            return each
    names = ", ".join(each.name for each in FORMATS if each.suffixes)
    raise CalibrationError(
        f"{path.name} is in no format of spectra that is read here ({names}). Export the spectrum as CSV."
    )


def read_spectra(path: Path) -> list[Spectrum]:
    """Every spectrum of a file, of whatever quantity; raises `CalibrationError` that names the file."""
    return format_of(path).read(path)
