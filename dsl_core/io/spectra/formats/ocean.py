"""Text of OceanView and SpectraSuite: a header, ``>>>>>Begin ... Spectral Data<<<<<``, two columns."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from dsl_core.errors import CalibrationError
from dsl_core.io.spectra.formats.columns import spectra_of
from dsl_core.io.spectra.records import Format, Spectrum, content_of
from dsl_core.io.spectra.text import Table, decoded, tables_of
from dsl_core.io.spectra.units import quantity_of

_BEGIN = re.compile(r">>>>>\s*Begin[^\n<]*Spectral Data\s*<<<<<[^\n]*\n")
_END = re.compile(r"\n>>>>>\s*End[^\n]*")
#: Counts of a spectrometer reach this; shares of light and percentages never do.
_MOST_PERCENT = 400.0


def is_ocean(path: Path, head: bytes) -> bool:
    """Whether a text has the line before which Ocean's programs write their header."""
    return bool(_BEGIN.search(decoded(head)))


def read_ocean(path: Path) -> list[Spectrum]:
    """The spectrum; counts where nothing says what else it is. Raises `CalibrationError`."""
    header, data = _BEGIN.split(decoded(content_of(path)), maxsplit=1)
    if re.search(r"(?i)x-?axis mode\s*:\s*(?!wavelength)\S", header):
        raise CalibrationError(
            f"{path.name} is not over wavelength. Choose wavelengths (nm) for the axis and export again."
        )
    tables = tables_of(path, _END.split(data)[0])
    # Nothing of the header's settings is a unit; only what was measured is said there.
    said = "\n".join(re.findall(r"(?:Data from|Spectrum|Processing)[^\n]*", header))
    spectra = []
    for table in tables[:1]:
        width = table.cells.shape[1]
        bare = Table("", ("nm", *[said] * (width - 1)), ("",) * width, table.cells, table.lines)
        spectra = [_judged(spectrum, said) for spectrum in spectra_of(path, bare)]
    if not spectra:
        raise CalibrationError(f"{path.name} has no spectrum behind its header. Export it again.")
    return spectra


def _judged(spectrum: Spectrum, said: str) -> Spectrum:
    quantity, factor, _ = quantity_of(said)
    if quantity in ("reflectance", "transmittance"):
        # These programs compute both in percent, of dark samples too; a sample's name may look like a unit.
        return Spectrum("", spectrum.nm, spectrum.values * (0.01 / factor), quantity, True)
    if quantity == "unstated" and float(np.nanmax(spectrum.values)) > _MOST_PERCENT:
        quantity = "counts"
    return Spectrum("", spectrum.nm, spectrum.values, quantity)


FORMAT = Format("Ocean", (".txt", ".jaz"), is_ocean, read_ocean)
