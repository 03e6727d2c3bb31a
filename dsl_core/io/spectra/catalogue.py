"""All formats of spectra, recognised by content: a new one is a file in ``formats/`` and a line here.

Packages add some by the entry-point group ``dsl_scan.spectra``, whose values are `Format`.
"""

from __future__ import annotations

import logging
from dataclasses import replace
from functools import cache
from pathlib import Path

from dsl_core.errors import CalibrationError
from dsl_core.io.plugins import load_plugins, told_as
from dsl_core.io.reading import require_plain
from dsl_core.io.spectra.formats import (
    asd,
    avantes,
    cgats,
    columns,
    envi,
    jcamp,
    konica_minolta,
    light_meter,
    ocean,
    one_column,
    own_table,
    sed,
    spreadsheet,
    svc,
    tm27,
)
from dsl_core.io.spectra.records import HEAD_BYTES, Format, Spectrum

#: Those of this package in the order in which they are tried; the last takes any text.
FORMATS: tuple[Format, ...] = (
    envi.FORMAT,
    asd.FORMAT,
    spreadsheet.FORMAT,
    own_table.FORMAT,
    svc.FORMAT,
    jcamp.FORMAT,
    tm27.FORMAT,
    cgats.FORMAT,
    sed.FORMAT,
    ocean.FORMAT,
    avantes.FORMAT,
    konica_minolta.FORMAT,
    light_meter.FORMAT,
    one_column.FORMAT,
    columns.FORMAT,
)
GROUP = "dsl_scan.spectra"
_log = logging.getLogger(__name__)


@cache
def formats() -> tuple[Format, ...]:
    """All formats in the order in which they are tried: those of other packages before that for any text."""
    return (*FORMATS[:-1], *(_guarded(each) for each in load_plugins(GROUP, Format)), FORMATS[-1])


def _guarded(added: Format) -> Format:
    """A format of another package whose mistakes are told as its own, and keep nobody from other formats."""
    what = f"The format {added.name!r} of spectra"

    def recognises(path: Path, head: bytes) -> bool:
        try:
            with told_as(what, CalibrationError):
                return added.recognises(path, head)
        except CalibrationError as error:
            _log.warning("%s", error)
            return False

    def read(path: Path) -> list[Spectrum]:
        with told_as(f"{what}, asked to read {path}", CalibrationError):
            return added.read(path)

    return replace(added, recognises=recognises, read=read)


def suffixes() -> tuple[str, ...]:
    """Endings of files that can contain spectra, each once, for a list of files."""
    return tuple(dict.fromkeys(s for each in reversed(formats()) for s in each.suffixes))


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
    for each in formats():
        if each.recognises(path, head):
            return each
    names = ", ".join(each.name for each in formats() if each.suffixes)
    raise CalibrationError(
        f"{path.name} is in no format of spectra that is read here ({names}). Export the spectrum as CSV."
    )


def read_spectra(path: Path) -> list[Spectrum]:
    """Every spectrum of a file, of whatever quantity; raises `CalibrationError` that names the file."""
    return format_of(path).read(path)
