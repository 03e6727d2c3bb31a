"""A column of values whose wavelengths are in another file, as the spectral library of the USGS has them.

Layout: Kokaly et al., "USGS Spectral Library Version 7", Data Series 1035 (2017). The first line names the
library, the record, the material, the instrument and the quantity (AREF: absolute reflectance); the
wavelengths of each instrument are a file of the same layout in the folder above.
"""

from __future__ import annotations

import re
from functools import lru_cache
from pathlib import Path

import numpy as np

from dsl_core.errors import CalibrationError
from dsl_core.io.spectra.records import (
    HEAD_BYTES,
    Floats,
    Format,
    Quantity,
    Spectrum,
    content_of,
    rising,
)
from dsl_core.io.spectra.text import MIN_ROWS, decoded, is_text, number_of
from dsl_core.io.spectra.units import to_nanometres

#: Lines of a header before the values.
MOST_HEADER = 3
#: Folders in which wavelengths are looked for: that of the file, and so many above it.
FOLDERS_ABOVE = 2
_IS_AXIS = re.compile(r"wavelengths?(?![a-z])", re.IGNORECASE)
#: Files of the USGS that are no spectra: wavelengths and widths of channels, and deviations of others.
_DESCRIBES = re.compile(r"^s(?:plib)?07.*(?:wavelengths|bandpass)|^errorbars_for_", re.IGNORECASE)
_RECORD = re.compile(r"\s*\w+\s+Record\s*=\s*\d+\s*:\s*(?P<said>.+)")
_INSTRUMENT = re.compile(r"(?<![A-Za-z])(ASD|BECK|NIC4|AVIRIS)")
_QUANTITIES: dict[str, Quantity] = {"AREF": "reflectance", "RREF": "reflectance", "TRAN": "transmittance"}


def is_one_column(path: Path, head: bytes) -> bool:
    """Whether a text is a few words and then one number a line."""
    if not is_text(head):
        return False
    lines = decoded(head).rstrip().splitlines()
    if len(head) == HEAD_BYTES:
        # The last line may be cut off.
        lines = lines[:-1]
    begins = _header_lines(lines)
    return begins <= MOST_HEADER and len(lines) - begins >= MIN_ROWS and all(map(_is_number, lines[begins:]))


def describes_others(path: Path) -> bool:
    """Whether a file of a library is no spectrum: wavelengths, widths of channels, or deviations."""
    return bool(_DESCRIBES.search(path.name))


def read_one_column(path: Path) -> list[Spectrum]:
    """The spectrum; raises `CalibrationError` without a file of as many wavelengths near it."""
    header, values = _column(path)
    nm, values = rising(path, _wavelengths_of(path, header, len(values)), values)
    record = _RECORD.match(header)
    if record is None:
        return [Spectrum("", nm, values)]
    words = str(record["said"]).split()
    if len(words) < 3 or words[-1] not in _QUANTITIES:
        return [Spectrum(" ".join(words), nm, values)]
    # Last come the instrument and the quantity.
    return [Spectrum(" ".join(words[:-2]), nm, values, _QUANTITIES[words[-1]], True)]


def _wavelengths_of(path: Path, header: str, count: int) -> Floats:
    folders = (path.parent, *list(path.resolve().parent.parents)[:FOLDERS_ABOVE])
    for folder in folders:
        fitting = {file: axis for file, axis in _axes(folder) if len(axis) == count and file != path}
        if len(fitting) > 1:
            own = _INSTRUMENT.findall(header) or _INSTRUMENT.findall(path.name.replace("_", " "))
            named = {f: axis for f, axis in fitting.items() if own and own[-1] in f.name}
            fitting = named or fitting
        axes = list(fitting.values())
        if axes and all(np.array_equal(axis, axes[0]) for axis in axes):
            return axes[0]
        if axes:
            names = " and ".join(file.name for file in list(fitting)[:2])
            raise CalibrationError(
                f"{path.name} has {count} values, and {names} as many different wavelengths each. Leave only"
                " that of its instrument in the folder."
            )
    raise CalibrationError(
        f"{path.name} has {count} values in one column, and no file near it has their wavelengths. Put the"
        " one of its instrument, such as splib07a_Wavelengths_ASD_0.35-2.5_microns_2151_ch.txt, into its"
        " folder or the one above, or export wavelengths and values as two columns."
    )


def _axes(folder: Path) -> list[tuple[Path, Floats]]:
    """Wavelengths (nm) in files of a folder whose name says so; those that cannot be read are none."""
    files = [file for file in folder.glob("*.txt") if _IS_AXIS.search(file.name) and file.is_file()]
    return [(file, axis) for file in sorted(files) if len(axis := _axis(file, file.stat().st_mtime_ns))]


@lru_cache(maxsize=32)
def _axis(file: Path, changed_ns: int) -> Floats:
    """Wavelengths (nm) of a file, empty where it has none; ``changed_ns`` tells a file that was changed."""
    try:
        header, values = _column(file)
        if not np.isfinite(values).all():
            return np.empty(0)
        if "micron" in f"{header} {file.name}".lower():
            return values * 1e3
        return to_nanometres(file, values, "wavelength", header)
    except CalibrationError:
        return np.empty(0)


def _column(path: Path) -> tuple[str, Floats]:
    """The header and the values, NaN where one was deleted; raises `CalibrationError`."""
    lines = decoded(content_of(path)).rstrip().splitlines()
    begins = _header_lines(lines)
    odd = next((i for i in range(begins, len(lines)) if not _is_number(lines[i])), None)
    if odd is not None or len(lines) - begins < MIN_ROWS:
        at = f"line {odd + 1} is not a number" if odd is not None else "it has hardly any"
        raise CalibrationError(f"{path.name} should be a column of numbers, but {at}. Copy it again.")
    return " ".join(lines[:begins]), np.array([number_of(line.strip()) for line in lines[begins:]])


def _header_lines(lines: list[str]) -> int:
    return next((i for i, line in enumerate(lines) if _is_number(line)), len(lines))


def _is_number(line: str) -> bool:
    try:
        float(line)
    except ValueError:
        return False
    return True


FORMAT = Format(
    "a column with its wavelengths in another file", (), is_one_column, read_one_column, is_named=True
)
