"""Spectra of lamps and materials in the exchange format of the lighting industry (IES TM-27-14, .spdx)."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from dsl_core.errors import CalibrationError
from dsl_core.io.spectra.records import Format, Quantity, Spectrum, content_of, rising
from dsl_core.io.spectra.text import MIN_ROWS, decoded, number_of

#: No parser of XML, as entities of a file that strangers send could fill the memory.
_VALUE = re.compile(
    r"<SpectralData\s+wavelength\s*=\s*[\"']([^\"'<]{1,40})[\"']\s*>([^<]{1,60})</SpectralData>"
)
_QUANTITY = re.compile(r"<SpectralQuantity>\s*([\w-]{1,40})\s*</SpectralQuantity>")
_DESCRIPTION = re.compile(r"<Description>([^<]{1,200})</Description>")
#: Shares in the standard's own scale, and radiance in W/(sr m2 nm).
_KNOWN: dict[str, Quantity] = {
    "reflectance": "reflectance",
    "transmittance": "transmittance",
    "radiance": "radiance",
    "irradiance": "irradiance",
}


def read_tm27(path: Path) -> list[Spectrum]:
    """The one spectrum of a file, whose quantity the standard names; raises `CalibrationError`."""
    text = decoded(content_of(path))
    pairs = [(number_of(nm.strip()), number_of(value.strip())) for nm, value in _VALUE.findall(text)]
    if len(pairs) < MIN_ROWS or not np.isfinite(np.array(pairs)[:, 0]).all():
        raise CalibrationError(
            f"{path.name} has {len(pairs)} readable values of <SpectralData>; {MIN_ROWS} or more with their"
            " wavelengths are needed. Export the spectrum again, or as CSV."
        )
    nm, values = rising(path, *np.array(pairs).T)
    stated, described = _QUANTITY.search(text), _DESCRIPTION.search(text)
    quantity = _KNOWN.get(stated[1].lower()) if stated else None
    name = described[1].strip() if described else ""
    return [
        Spectrum(
            name, nm, values, quantity or "unstated", quantity in ("reflectance", "transmittance", "radiance")
        )
    ]


FORMAT = Format("IES TM-27", (".spdx",), lambda path, head: b"<IESTM2714" in head, read_tm27)
