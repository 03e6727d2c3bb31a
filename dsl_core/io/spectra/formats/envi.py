"""Libraries of ENVI as a format of spectra."""

from __future__ import annotations

from pathlib import Path

from dsl_core.io.spectra.envi_library import read_library
from dsl_core.io.spectra.records import Format, Spectrum

SUFFIXES = (".sli", ".hdr")


def read_envi(path: Path) -> list[Spectrum]:
    """Every spectrum of a library; raises `CalibrationError`."""
    nm, names, values, scaled = read_library(path)
    return [Spectrum(name, nm, each, "reflectance", scaled) for name, each in zip(names, values, strict=True)]


FORMAT = Format(
    "ENVI library",
    SUFFIXES,
    lambda path, head: path.suffix.lower() in SUFFIXES or head.startswith(b"ENVI\n"),
    read_envi,
    is_named=True,
)
