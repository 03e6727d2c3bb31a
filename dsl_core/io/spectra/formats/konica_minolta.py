"""Exports of Konica Minolta's CS-2000 and CS-1000: radiance in W/(sr m2 nm), in columns or in lines."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

from dsl_core.io.spectra.formats.columns import read_columns
from dsl_core.io.spectra.records import Format, Spectrum
from dsl_core.io.spectra.text import decoded, is_text

_NAMED = re.compile(r"\bCS-?(?:[12]000A?|S10w)\b|Konica[ -]Minolta", re.IGNORECASE)


def is_konica_minolta(path: Path, head: bytes) -> bool:
    """Whether a text names the instrument or its program in its first lines."""
    return is_text(head) and bool(_NAMED.search(decoded(head[:4096])))


def read_konica_minolta(path: Path) -> list[Spectrum]:
    """All measurements; what states no quantity is the radiance that the instrument measures."""
    return [
        replace(spectrum, quantity="radiance", scaled=True) if spectrum.quantity == "unstated" else spectrum
        for spectrum in read_columns(path)
    ]


FORMAT = Format("Konica Minolta CS-2000", (".csv", ".txt"), is_konica_minolta, read_konica_minolta)
