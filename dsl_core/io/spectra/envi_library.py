"""Spectral libraries of ENVI: many spectra in ``NAME.sli``, described by ``NAME.hdr``.

The header is read here and not by the `spectral` package, which takes only the system's encoding, fails on
numbers of bands that differ with an exception that names no file, and leaves out the header's offset.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from dsl_core.errors import CalibrationError
from dsl_core.io.reading import read_bounded, require_plain
from dsl_core.io.spectra.records import MOST_NUMBER, most_of

Floats = NDArray[np.float64]
LIBRARY = "envi spectral library"
#: Endings that the data may have; the first is what ENVI writes.
DATA_SUFFIXES = (".sli", ".SLI", ".dat", ".img", "")
#: Kinds of numbers by the header's code; complex ones are not reflectance.
_KINDS = {
    **{"1": "u1", "2": "i2", "3": "i4", "4": "f4", "5": "f8"},
    **{"12": "u2", "13": "u4", "14": "i8", "15": "u8"},
}
_NANOMETRES = dict.fromkeys(("nanometers", "nanometres", "nanometer", "nanometre", "nm"), 1.0)
_NANOMETRES |= dict.fromkeys(
    ("micrometers", "micrometres", "micrometer", "micrometre", "um", "µm", "μm"), 1e3
)
_NANOMETRES |= dict.fromkeys(("microns", "micron"), 1e3)
#: Without repetitions within each other: the time stays in proportion to the length, whatever the text.
_FIELD = re.compile(r"^([^=;{}\n]+)=[ \t]*(\{[^{}]*\}|[^\n]*)", re.MULTILINE)
#: Digits of a whole number, and values of a library, that no instrument reaches.
_MOST_DIGITS, _MOST_VALUES = 12, 100_000_000
#: What a header calls the factor that its values were multiplied by.
_SCALE = "reflectance scale factor"
#: Reflectance above this can only be a percentage, above a hundred times this only a count of unstated scale.
MOST = 2.0


def read_library(path: Path) -> tuple[Floats, list[str], Floats, bool]:
    """Wavelengths (nm, rising), names, and reflectance (spectra, bands) of a library; NaN for no value.

    The last says whether the header states a scale, so that values are shares; else they may be percent.
    ``path`` is the header or the data. Micrometres are converted where the header says so, and a stated scale
    is divided by. Bands that ``bbl`` marks as bad have no values; at the ends they are left out. Raises
    `CalibrationError` that names the file.
    """
    header_path, data_path = _pair(path)
    header = _read_header(header_path)
    if header.get("file type", "").lower() != LIBRARY:
        raise CalibrationError(
            f"{header_path.name} describes {header.get('file type') or 'no ENVI file'}, not an ENVI spectral"
            " library. Choose a library (.sli), or export the spectrum as text in two columns."
        )
    values = _read_data(header_path, data_path, header)
    nm = _wavelengths_nm(header_path, header, values.shape[1])
    order = np.argsort(nm)
    if np.any(np.diff(nm[order]) <= 0):
        raise CalibrationError(f"{header_path.name}: wavelengths occur twice. Correct the header.")
    is_good = _is_good(header_path, header, len(nm))
    values = _reflectance(header_path, header, nm, np.where(is_good, values, np.nan))
    # What is bad at the ends was not measured; in the midst it is a gap, and nobody may bridge it.
    known = np.flatnonzero(is_good[order])
    order = order[known[0] : known[-1] + 1]
    return nm[order], _names(header, len(values)), values[:, order], _SCALE in header


def _pair(path: Path) -> tuple[Path, Path]:
    """The header and the data, one of which was chosen."""
    if path.suffix.lower() == ".hdr":
        found = [data for suffix in DATA_SUFFIXES if (data := path.with_suffix(suffix)).is_file()]
        if not found:
            raise CalibrationError(
                f"The spectra that {path.name} describes are not next to it. Put {path.stem}.sli there."
            )
        return path, found[0]
    headers = (path.with_suffix(".hdr"), path.with_suffix(".HDR"), path.with_name(f"{path.name}.hdr"))
    for header in headers:
        if header.is_file():
            return header, path
    raise CalibrationError(
        f"{path.name} has no header to describe its contents. Put {headers[0].name} next to it."
    )


def _read_header(path: Path) -> dict[str, str]:
    """The fields of a header by their names in small letters, lists with their commas but without braces."""
    try:
        content = read_bounded(path)
    except OSError as error:
        raise CalibrationError(
            f"The header {path} cannot be read ({error.strerror or error}). Correct its path."
        ) from error
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = content.decode("latin-1")
    text = text.replace("\r\n", "\n")
    return {key.strip().lower(): value.strip().strip("{}").strip() for key, value in _FIELD.findall(text)}


def _read_data(path: Path, data: Path, header: Mapping[str, str]) -> Floats:
    bands, spectra = (_whole(path, header, key) for key in ("samples", "lines"))
    kind = _KINDS.get(header.get("data type", ""))
    if kind is None or _whole(path, header, "bands", 1) != 1:
        raise CalibrationError(
            f"{path.name}: a library of one plane of real numbers is needed; the header says"
            f" bands = {header.get('bands', '?')} and data type = {header.get('data type', '?')}."
            " Export the library again."
        )
    dtype = np.dtype(kind).newbyteorder(">" if header.get("byte order", "0") == "1" else "<")
    offset, wanted = _whole(path, header, "header offset", 0), bands * spectra
    try:
        there = (require_plain(data) - offset) // dtype.itemsize
        if there < wanted:
            raise CalibrationError(
                f"{data.name} is cut off: {spectra} spectra of {bands} bands are {wanted} values, but it"
                f" contains {max(there, 0)}. Copy it again."
            )
        if wanted > _MOST_VALUES:
            raise CalibrationError(
                f"{path.name} declares {wanted} values; at most {_MOST_VALUES} are read. Split the library."
            )
        values = np.fromfile(data, dtype, wanted, offset=offset)
    except OSError as error:
        raise CalibrationError(f"The library {data} cannot be read ({error}). Correct its path.") from error
    return values.reshape(spectra, bands).astype(np.float64)


def _whole(path: Path, header: Mapping[str, str], key: str, default: int | None = None) -> int:
    text = header.get(key, "" if default is None else str(default))
    if not text.isdecimal() or len(text) > _MOST_DIGITS or (default is None and int(text) == 0):
        raise CalibrationError(
            f"{path.name}: a whole number is needed as {key!r}; the header says {text[:40] or 'nothing'!r}."
            " Correct the header."
        )
    return int(text)


def _wavelengths_nm(path: Path, header: Mapping[str, str], bands: int) -> Floats:
    try:
        given = np.array([float(cell) for cell in header.get("wavelength", "").split(",") if cell.strip()])
    except ValueError as error:
        raise CalibrationError(f"{path.name}: a wavelength is not a number ({error}). Correct it.") from error
    if len(given) != bands or not np.isfinite(given).all():
        raise CalibrationError(
            f"{path.name} names {len(given)} wavelengths for {bands} bands. Add what is missing."
        )
    units = header.get("wavelength units", "").lower()
    factor = _NANOMETRES.get(units)
    if factor is None and (units not in ("", "unknown") or given.max() < 100):
        raise CalibrationError(
            f"{path.name}: wavelengths from {given.min():g} to {given.max():g} {units or 'of unstated unit'};"
            " nanometres or micrometres are needed. Add 'wavelength units' to the header."
        )
    return given * (factor or 1.0)


def _names(header: Mapping[str, str], count: int) -> list[str]:
    """The names of the spectra, numbers for those without one; all numbers where a comma splits a name."""
    given = [" ".join(name.split()) for name in header.get("spectra names", "").split(",")]
    known = given if len(given) == count else [""] * count
    return [name or f"spectrum {i}" for i, name in enumerate(known, 1)]


def _is_good(path: Path, header: Mapping[str, str], bands: int) -> NDArray[np.bool_]:
    """Bands that the header does not mark with 0 in its list of bad ones, shape (bands,)."""
    cells = [cell.strip() for cell in header.get("bbl", "").split(",") if cell.strip()]
    if not cells:
        return np.ones(bands, bool)
    try:
        marks = np.array([float(cell) for cell in cells])
    except ValueError as error:
        raise CalibrationError(
            f"{path.name}: a mark of bbl is not a number ({error}). Correct it."
        ) from error
    if len(marks) != bands or not marks.any():
        raise CalibrationError(
            f"{path.name}: bbl marks {np.count_nonzero(marks)} of {len(marks)} bands as good, for {bands}"
            " bands. Correct it, or remove it."
        )
    return np.asarray(marks != 0)


def _reflectance(path: Path, header: Mapping[str, str], nm: Floats, values: Floats) -> Floats:
    """Values as shares of light; NaN for what the header or an absurd number marks as deleted."""
    deleted = ~(np.abs(values) < MOST_NUMBER)
    try:
        scale = float(header.get(_SCALE, 1.0))
        if "data ignore value" in header:
            # Data in 32 bits has not all digits of the header.
            deleted |= np.isclose(values, float(header["data ignore value"]), rtol=1e-6, atol=0.0)
    except ValueError as error:
        raise CalibrationError(
            f"{path.name}: the scale factor or ignore value is not a number ({error}). Correct the header."
        ) from error
    values = np.where(deleted, np.nan, values / (scale if scale > 0 else 1.0))
    most = max(most_of(nm, spectrum) for spectrum in values)
    if most > 100 * MOST:
        raise CalibrationError(
            f"{path.name} contains values up to {most:g}; reflectance from 0 to 1 is needed. Add the factor"
            f" that they were multiplied by to the header, as {_SCALE!r}."
        )
    return values * (0.01 if most > MOST and _SCALE in header else 1.0)
