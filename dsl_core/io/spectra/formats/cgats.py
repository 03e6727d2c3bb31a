"""CGATS.17 tables (X-Rite, i1Profiler) and those of ArgyllCMS (``.sp``, ``.ti3``, ``.ccss``)."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from dsl_core.errors import CalibrationError
from dsl_core.io.spectra.records import Format, Quantity, Spectrum, content_of, rising
from dsl_core.io.spectra.text import MOST_CELLS, decoded, number_of

_WORD = re.compile(r'"[^"\n]*"|[^\s"]+')
_FIELD = re.compile(r"(?:SPECTRAL_?(?:NM_?)?|SPEC_?|NM_?|R_)(\d{3,5}(?:\.\d+)?)", re.IGNORECASE)
_NAMES = ("SAMPLE_NAME", "SAMPLE_ID", "SAMPLENAME", "SAMPLEID")
#: ArgyllCMS says what it measured; the light of emissive colours is in mW/(m2 sr nm).
_KINDS: dict[str, tuple[Quantity, float]] = {
    "EMISSION": ("radiance", 1e-3),
    "AMBIENT": ("irradiance", 1.0),
    "REFLECTIVE": ("reflectance", 1.0),
    "TRANSMISSIVE": ("transmittance", 1.0),
}


def is_cgats(path: Path, head: bytes) -> bool:
    """Whether a text has the keywords between which such tables stand."""
    return bool(re.search(rb"^\s*BEGIN_DATA(?:_FORMAT)?\s*$", head, re.MULTILINE))


def read_cgats(path: Path) -> list[Spectrum]:
    """Every row of every table that has spectral fields; raises `CalibrationError`."""
    spectra: list[Spectrum] = []
    known: dict[str, str] = {}
    fields: list[str] = []
    data: list[str] = []
    room = ""
    for line in decoded(content_of(path)).splitlines():
        words = [word.strip('"') for word in _WORD.findall(line)]
        if not words or words[0].startswith("#"):
            continue
        key = words[0].upper()
        if key in ("BEGIN_DATA_FORMAT", "BEGIN_DATA"):
            room = key
        elif key == "END_DATA_FORMAT":
            room = ""
        elif key == "END_DATA":
            spectra += _rows(path, known, fields, data)
            room, fields, data = "", [], []
        elif room == "BEGIN_DATA_FORMAT":
            fields += words
        elif room == "BEGIN_DATA":
            data += words
        elif len(words) > 1:
            known[key] = " ".join(words[1:])
    if not spectra:
        why = "its table does not end" if room else "it has no spectral fields such as SPECTRAL_NM400"
        raise CalibrationError(f"{path.name} contains no spectra: {why}. Export it with spectral data.")
    return spectra


def _rows(path: Path, known: dict[str, str], fields: list[str], data: list[str]) -> list[Spectrum]:
    bands = _bands(path, known)
    if not fields and bands is not None:
        fields = [f"SPEC_{nm:g}" for nm in bands] if len(data) % len(bands) == 0 else []
    columns = [i for i, field in enumerate(fields) if _FIELD.fullmatch(field)]
    if len(columns) < 2:
        return []
    if len(data) % len(fields) or len(data) > MOST_CELLS:
        raise CalibrationError(
            f"{path.name}: {len(data)} values do not fill rows of {len(fields)} fields. Export it again."
        )
    # The fields have whole nanometres; the keywords say where the bands really are.
    labels = [match[1] for i in columns if (match := _FIELD.fullmatch(fields[i]))]
    nm = bands if bands is not None and len(bands) == len(columns) else np.array([float(x) for x in labels])
    quantity, factor = _KINDS.get(known.get("MEAS_TYPE", "").upper(), ("unstated", 1.0))
    norm = _number(known.get("SPECTRAL_NORM", "1"))
    if not 0 < norm < 1e9:
        raise CalibrationError(f"{path.name}: a SPECTRAL_NORM of {norm:g} is impossible. Export it again.")
    name_at = next((fields.index(name) for name in _NAMES if name in fields), None)
    spectra = []
    for row in range(0, len(data), len(fields)):
        values = np.array([_number(data[row + i]) for i in columns])
        rising_nm, values = rising(path, nm, values)
        name = data[row + name_at] if name_at is not None else ""
        is_scaled = quantity != "unstated" and "SPECTRAL_NORM" in known
        spectra.append(Spectrum(name, rising_nm, values * factor / norm, quantity, is_scaled))
    return spectra


def _bands(path: Path, known: dict[str, str]) -> np.ndarray | None:
    keys = ("SPECTRAL_START_NM", "SPECTRAL_END_NM", "SPECTRAL_BANDS")
    start, end, count = (_number(known.get(key, "")) for key in keys)
    if not np.isfinite([start, end, count]).all():
        return None
    if not 2 <= count <= 10_000:
        raise CalibrationError(f"{path.name}: SPECTRAL_BANDS is {count:g}. Export it again.")
    return np.linspace(start, end, int(count))


def _number(word: str) -> float:
    """The number that a word is, NaN if none; programs of some languages write "0,2"."""
    return number_of(word.replace(",", "."))


FORMAT = Format("CGATS, ArgyllCMS", (".cgats", ".sp", ".ti3", ".ccss", ".cie"), is_cgats, read_cgats)
