"""Spectra of ASD FieldSpec and LabSpec instruments, revisions 1 to 8 of their binary format.

Layout: ASD Inc., "ASD File Format, Version 8". A header of 484 bytes, the spectrum, and from revision 2 on a
block for the white reference: flag (2 bytes), two times (8 each), a description behind its length, values.
"""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np

from dsl_core.errors import CalibrationError
from dsl_core.io.spectra.records import (
    MOST_NUMBER,
    Floats,
    Format,
    Quantity,
    Spectrum,
    content_of,
    most_of,
    rising,
)

HEADER_BYTES = 484
_VERSIONS = {b"ASD", b"asd", *(b"as%d" % revision for revision in range(2, 9))}
#: By the header's data type; what is missing is not a spectrum of light.
_QUANTITIES: dict[int, Quantity] = {
    **{0: "counts", 1: "reflectance", 2: "radiance", 4: "irradiance", 6: "transmittance", 8: "absorbance"}
}
_FORMATS = {0: "<f4", 1: "<i4", 2: "<f8"}
#: Reflectance that is stored as such stays below this; counts that are still to be divided do not.
_MOST_SHARE = 3.0
#: A radiance above this, W/(sr m2 nm), is counts that the instrument's own program would convert.
_MOST_RADIANCE = 50.0


def is_asd(path: Path, head: bytes) -> bool:
    """Whether a file begins as ASD's do."""
    return head[:3] in _VERSIONS and b"\0" in head[:HEADER_BYTES]


def read_asd(path: Path) -> list[Spectrum]:
    """The spectrum; counts with a white reference become reflectance. Raises `CalibrationError`."""
    content = content_of(path)
    if len(content) < HEADER_BYTES:
        raise _cut(path, len(content), HEADER_BYTES)
    kind, form = content[186], content[199]
    start_nm, step_nm = struct.unpack_from("<ff", content, 191)
    (channels,) = struct.unpack_from("<H", content, 204)
    dtype = _FORMATS.get(form)
    if dtype is None or channels < 2 or not (0.01 <= step_nm <= 1000 and 0 < start_nm < 1e5):
        raise CalibrationError(
            f"{path.name}: its header states {channels} channels from {start_nm:g} nm in steps of"
            f" {step_nm:g} nm, in number format {form}; no ASD instrument writes this. Copy it again."
        )
    values, end = _values(path, content, HEADER_BYTES, dtype, channels)
    nm = start_nm + step_nm * np.arange(channels, dtype=np.float64)
    quantity = _QUANTITIES.get(kind, "unstated")
    is_done = kind == 1 and most_of(nm, values) <= _MOST_SHARE
    if kind in (0, 1) and not is_done and content[:3] not in (b"ASD", b"asd"):
        white = _white(path, content, end, dtype, channels)
        if white is not None:
            with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
                values, quantity = np.where(white > 0, values / white, np.nan), "reflectance"
        elif kind == 1:
            quantity = "counts"
    if quantity == "radiance" and most_of(nm, values) > _MOST_RADIANCE:
        quantity = "counts"
    nm, values = rising(path, nm, values)
    return [Spectrum("", nm, values, quantity, quantity in ("reflectance", "transmittance", "radiance"))]


def _white(path: Path, content: bytes, at: int, dtype: str, channels: int) -> Floats | None:
    """The white reference, None where the flag says that there is none."""
    if len(content) < at + 20:
        return None
    flag, length = struct.unpack_from("<H", content, at)[0], struct.unpack_from("<H", content, at + 18)[0]
    if not flag:
        return None
    values, _ = _values(path, content, at + 20 + length, dtype, channels)
    return values if np.any(values > 0) else None


def _values(path: Path, content: bytes, at: int, dtype: str, count: int) -> tuple[Floats, int]:
    end = at + count * np.dtype(dtype).itemsize
    if end > len(content):
        raise _cut(path, len(content), end)
    values = np.frombuffer(content, dtype, count, at).astype(np.float64)
    return np.where(np.abs(values) < MOST_NUMBER, values, np.nan), end


def _cut(path: Path, size: int, wanted: int) -> CalibrationError:
    return CalibrationError(
        f"{path.name} is cut off: its spectra end at byte {wanted}, but it has {size} bytes. Copy it again."
    )


FORMAT = Format("ASD FieldSpec", (".asd",), is_asd, read_asd)
