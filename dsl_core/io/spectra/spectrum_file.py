"""Spectra from the text files of spectroradiometers: two columns after a header of any length."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from dsl_core.errors import CalibrationError
from dsl_core.io.reading import read_bounded
from dsl_core.model.spectral import SpectralCurve

#: What radiance is kept in.
RADIANCE_UNIT = "W/(sr m2 nm)"
#: Fewer rows of numbers are part of a header.
MIN_ROWS = 8
_NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?|[-+]?(?:nan|inf)\b", re.IGNORECASE)
_PREFIXES = {"": 1.0, "m": 1e-3, "µ": 1e-6, "μ": 1e-6, "u": 1e-6, "k": 1e3}
#: "W/(sr m2 nm)", "mW/m^2/sr/nm", "W·sr⁻¹·m⁻²·nm⁻¹": a power, then steradian somewhere behind it.
_RADIANCE = re.compile(r"(?<![a-zA-Zµμ])([mµμuk]?)W\b[^\n]{0,12}?(?:sr|m)", re.UNICODE)
_PER_MICROMETRE = re.compile(r"W\b[^\n]*?[/ *·(](?:um|µm|μm)\b")
_MICROMETRES = re.compile(
    r"(?:wavelength|lambda|λ)(?:(?!nm)[^\n\t;,]){0,20}?[\[(/ ](?:um|µm|μm)\b", re.IGNORECASE
)
_OTHER = {"percent": re.compile(r"%|percent", re.IGNORECASE), "counts": re.compile(r"\bcounts?\b", re.I)}


def read_spectrum(
    path: Path, covers_nm: tuple[float, float] = (430.0, 660.0), radiance: bool = True
) -> SpectralCurve:
    """The first spectrum of a text file: wavelength (nm) and value in columns, whatever stands around them.

    Separators are tabs, semicolons, commas or spaces; with tabs or semicolons a decimal comma is understood.
    Radiance is returned in W/(sr m2 nm), a stated mW or µW converted; ``radiance=False`` reads a quantity
    without unit such as a reflectance (a stated percentage is converted). Raises `CalibrationError` that
    names file and line for wavelengths in other units, out of order or too few, values that are not numbers,
    and quantities that are not radiance.
    """
    try:
        text = read_bounded(path).decode("utf-8-sig", errors="replace")
    except OSError as error:
        raise CalibrationError(
            f"The spectrum {path} cannot be read ({error.strerror or error}). Correct its path."
        ) from error
    header, rows, numbers = _split(text)
    if len(rows) < MIN_ROWS:
        raise CalibrationError(
            f"{path.name} contains no table of wavelengths and values. Export the spectrum as text in"
            " two columns."
        )
    nm, values = np.array(rows).T
    _check_values(path, nm, values, numbers)
    _check_wavelengths(path, header, nm, covers_nm)
    factor, unit = _factor(path, header) if radiance else (_share(header, values), "1")
    return SpectralCurve.of(nm, values * factor, unit=unit)


def _split(text: str) -> tuple[str, list[tuple[float, float]], list[int]]:
    """The header, the rows of the first table, and the number of each row's line."""
    header: list[str] = []
    rows: list[tuple[float, float]] = []
    numbers: list[int] = []
    for number, line in enumerate(text.splitlines(), 1):
        row = _row(line)
        if row is not None:
            rows.append(row)
            numbers.append(number)
        elif len(rows) >= MIN_ROWS:
            break  # behind the table
        else:
            header += [line, *(f"{a:g} {b:g}" for a, b in rows)]
            rows, numbers = [], []
    return "\n".join(header), rows, numbers


def _row(line: str) -> tuple[float, float] | None:
    cells = re.split(r"[;\t]", line.strip()) if re.search(r"[;\t]", line.strip()) else None
    if cells is not None:
        cells = [cell.strip().strip('"').replace(",", ".") for cell in cells]
    else:
        cells = [cell.strip('"') for cell in re.split(r"[,\s]+", line.strip())]
    cells = [cell for cell in cells if cell]
    if len(cells) < 2 or not all(_NUMBER.fullmatch(cell) for cell in cells[:2]):
        return None
    return float(cells[0]), float(cells[1])


def _check_values(path: Path, nm: np.ndarray, values: np.ndarray, numbers: list[int]) -> None:
    bad = ~(np.isfinite(nm) & np.isfinite(values))
    if bad.any():
        raise CalibrationError(
            f"{path.name}, line {numbers[int(bad.argmax())]}: a value is not a finite number."
            " Measure this spectrum again, or leave out the range that the instrument does not cover."
        )


def _check_wavelengths(path: Path, header: str, nm: np.ndarray, covers_nm: tuple[float, float]) -> None:
    if nm.max() < 10 or _MICROMETRES.search(header):
        raise CalibrationError(
            f"{path.name}: the wavelengths, {nm.min():g} to {nm.max():g}, are micrometres; nanometres are"
            " needed. Export the spectrum in nm."
        )
    if np.any(np.diff(nm) <= 0):
        at = int(np.argmax(np.diff(nm) <= 0))
        raise CalibrationError(
            f"{path.name}: the wavelengths do not rise: {nm[at + 1]:g} comes after {nm[at]:g} nm. Export one"
            " spectrum per file, in rising order."
        )
    low, high = covers_nm
    if nm[0] > low or nm[-1] < high:
        raise CalibrationError(
            f"{path.name} covers {nm[0]:g} to {nm[-1]:g} nm; {low:g} to {high:g} nm are needed."
            " Measure the whole range."
        )


def _factor(path: Path, header: str) -> tuple[float, str]:
    """Factor to W/(sr m2 nm), one where no unit is stated."""
    found = _RADIANCE.search(header)
    if found is None:
        for name, pattern in _OTHER.items():
            if pattern.search(header):
                raise CalibrationError(
                    f"{path.name} contains {name}, not a spectral radiance. Export radiance in W/(sr m2 nm)."
                )
        return 1.0, RADIANCE_UNIT
    per_micrometre = 1e-3 if _PER_MICROMETRE.search(header) else 1.0
    return _PREFIXES[found[1]] * per_micrometre, RADIANCE_UNIT


def _share(header: str, values: np.ndarray) -> float:
    """Factor from a percentage to a share; values far above one can only be percentages."""
    return 0.01 if _OTHER["percent"].search(header) or values.max() > 2 else 1.0
