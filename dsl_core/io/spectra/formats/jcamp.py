"""JCAMP-DX 4 and 5: pairs, or values over even steps, written plainly or compressed (PAC, SQZ, DIF, DUP).

Source: R. S. McDonald and P. A. Wilks, "JCAMP-DX: A Standard Form for Exchange of Infrared Spectra in
Computer Readable Form", Applied Spectroscopy 42 (1988), 151-162.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from dsl_core.errors import CalibrationError
from dsl_core.io.spectra.records import MOST_NUMBER, Floats, Format, Spectrum, content_of, rising
from dsl_core.io.spectra.text import decoded
from dsl_core.io.spectra.units import quantity_of, to_nanometres

#: More values than any spectrum has; a compressed file could declare any number.
MOST_VALUES = 5_000_000
_RECORD = re.compile(r"^##([^=\n]{0,60})=", re.MULTILINE)
_PLAIN = re.compile(r"[-+]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][-+]?\d+)?")
_COMPRESSED = re.compile(r"[@%A-DF-Za-df-s]")
_TOKEN = re.compile(r"([@%A-Za-s+\-]?)(\d*(?:\.\d*)?)")
#: What a pseudo-digit stands for: a value, a difference, or a repetition, and its first digit with sign.
_DIGITS = {
    **{sign: ("value", sign) for sign in ("", "+", "-")},
    "@": ("value", "0"),
    **{char: ("value", str(i)) for i, char in enumerate("ABCDEFGHI", 1)},
    **{char: ("value", f"-{i}") for i, char in enumerate("abcdefghi", 1)},
    "%": ("step", "0"),
    **{char: ("step", str(i)) for i, char in enumerate("JKLMNOPQR", 1)},
    **{char: ("step", f"-{i}") for i, char in enumerate("jklmnopqr", 1)},
    **{char: ("times", str(i)) for i, char in enumerate("STUVWXYZs", 1)},
}


def read_jcamp(path: Path) -> list[Spectrum]:
    """Every spectrum of all blocks; raises `CalibrationError`."""
    spectra, fields = [], dict[str, str]()
    parts = _RECORD.split(decoded(content_of(path)))
    for label, value in zip(parts[1::2], parts[2::2], strict=True):
        key = re.sub(r"[\s/_-]", "", label).upper()
        value = re.sub(r"\$\$[^\n]*", "", value)
        if key == "TITLE":
            fields = {}
        fields[key] = value.strip()
        if key in ("XYDATA", "XYPOINTS"):
            spectra.append(_spectrum(path, fields, value))
        elif key in ("NTUPLES", "RADATA"):
            raise CalibrationError(
                f"{path.name} contains {key}, not a spectrum over wavelength. Export it as XYDATA."
            )
    if not spectra:
        raise CalibrationError(f"{path.name} contains no XYDATA. Export the spectrum as XYDATA.")
    return spectra


def _spectrum(path: Path, fields: dict[str, str], data: str) -> Spectrum:
    form, _, body = data.partition("\n")
    form = re.sub(r"\s", "", form).upper()
    if form == "(XY..XY)":
        pairs = _plain(path, body)
        if len(pairs) % 2:
            raise _damaged(path, "a pair lacks its second value")
        x = pairs[::2] * _number(path, fields, "XFACTOR", 1.0)
        y = pairs[1::2]
    elif form == "(X++(Y..Y))":
        count = int(_number(path, fields, "NPOINTS"))
        if not 2 <= count <= MOST_VALUES:
            raise _damaged(path, f"NPOINTS is {count}")
        y = _values(path, body, count)
        if len(y) != count:
            raise _damaged(path, f"{count} values are declared, but there are {len(y)}")
        x = np.linspace(_number(path, fields, "FIRSTX"), _number(path, fields, "LASTX"), count)
    else:
        raise _damaged(path, f"the data has the form {form[:30] or 'of nothing'}")
    if len(x) < 2 or not np.all(np.isfinite(x)):
        raise _damaged(path, "it has no two wavelengths")
    y = y * _number(path, fields, "YFACTOR", 1.0)
    nm, values = rising(path, *_over_wavelength(path, x, y, fields.get("XUNITS", "")))
    quantity, factor, is_scaled = quantity_of(fields.get("YUNITS", ""))
    title = " ".join(fields.get("TITLE", "").split())[:80]
    return Spectrum(title, nm, values * factor, quantity, is_scaled)


def _over_wavelength(path: Path, x: Floats, y: Floats, unit: str) -> tuple[Floats, Floats]:
    if re.fullmatch(r"\s*(?:1/CM|CM-1|CM\^-1|WAVENUMBERS?)\s*", unit, re.IGNORECASE):
        if np.any(x <= 0):
            raise _damaged(path, "a wavenumber is not above zero")
        return 1e7 / x, y
    return to_nanometres(path, x, unit), y


def _values(path: Path, body: str, most: int) -> Floats:
    """The values of all lines, without the abscissa at the beginning of each."""
    if not _COMPRESSED.search(body):
        lines = [re.sub(r"(?<![eE])([+-])", r" \1", line) for line in body.splitlines()]
        return np.concatenate([np.empty(0), *(_plain(path, line)[1:] for line in lines)])
    values: list[float] = []
    steps_before = False
    for line in body.splitlines():
        tokens = [token for token in _TOKEN.findall(line.replace(",", " ")) if any(token)]
        before = values[-1] if values else None
        at, step, is_step = len(values), 0.0, False
        for lead, digits in tokens[1:]:
            kind, first = _DIGITS.get(lead, ("value", lead))
            number = _to_float(path, first + digits)
            if kind == "times":
                times = int(number) - 1
                if not values or times < 0 or len(values) + times > most + 1:
                    raise _damaged(path, f"a value is repeated {number:g} times")
                values += [values[-1] + step * (i + 1) for i in range(times)]
                continue
            is_step, step = kind == "step", number if kind == "step" else 0.0
            if is_step and not values:
                raise _damaged(path, "it begins with a difference")
            values.append(values[-1] + step if is_step else number)
            if len(values) > most + len(body):
                raise _damaged(path, f"more than {most} values follow")
        if steps_before and before is not None and len(values) > at:
            if abs(values[at] - before) > 1e-6 * max(abs(before), 1.0):
                raise _damaged(path, f"a line begins with {values[at]:g} instead of {before:g}")
            del values[at]
        steps_before = is_step if tokens[1:] else steps_before
    return np.array(values)


def _plain(path: Path, text: str) -> Floats:
    words = re.split(r"[\s,;]+", text.strip())
    return np.array([_to_float(path, word) for word in words if word])


def _to_float(path: Path, text: str) -> float:
    if not _PLAIN.fullmatch(text) or not abs(float(text)) < MOST_NUMBER:
        raise _damaged(path, f"{text[:20]!r} is not a number")
    return float(text)


def _number(path: Path, fields: dict[str, str], key: str, default: float | None = None) -> float:
    if key not in fields and default is not None:
        return default
    return _to_float(path, fields.get(key, "").replace(",", "."))


def _damaged(path: Path, why: str) -> CalibrationError:
    return CalibrationError(f"{path.name} is damaged or no spectrum: {why}. Export it again, or as CSV.")


FORMAT = Format(
    "JCAMP-DX",
    (".jdx", ".dx", ".jcm", ".jcamp"),
    lambda path, head: bool(re.search(rb"^\s*##\s*(?:TITLE|JCAMP)", head[:2048], re.IGNORECASE)),
    read_jcamp,
    is_named=True,
)
