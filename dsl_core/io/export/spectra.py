"""Spectra of pins, regions and references side by side: a row a band, units in the names of the columns.

Where a spectrum has no value at a wavelength of another one, or no answer, it says ``nan``. Lines that begin
with ``#`` say where the data come from; ``pandas.read_csv(..., comment="#")`` skips them.
"""

from __future__ import annotations

import csv
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from io import StringIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from dsl_core.errors import StoreError
from dsl_core.io.export.common import provenance_of, require_suffix
from dsl_core.io.export.wording import csv_line, deviation_text, figure_text, header_lines
from dsl_core.io.spectra.formats.own_table import MEAN, WAVELENGTH
from dsl_core.io.staging import staged
from dsl_core.model.result_order import wavelengths_of

if TYPE_CHECKING:
    import xarray as xr

Floats = NDArray[np.floating[Any]]
#: How the other columns of a spectrum are called behind its name.
DEVIATION, COUNT, UNCERTAINTY = (
    ": deviation of its pixels (1)",
    ": n (pixels)",
    ": uncertainty of a pixel (1)",
)


@dataclass(frozen=True)
class NamedSpectrum:
    """A spectrum with its name, all arrays of shape (bands,).

    ``deviation`` is the scatter of the ``pixels`` that it is the mean of, ``uncertainty`` one standard
    deviation as stated for a single pixel; None where it does not exist, as for a reference. ``where`` says
    in words which part of the picture it is of, empty where it is of none.
    """

    name: str
    wavelengths_nm: Floats
    mean: Floats
    deviation: Floats | None = None
    uncertainty: Floats | None = None
    pixels: int | None = None
    where: str = ""


def named_spectrum(spectrum: xr.Dataset) -> NamedSpectrum:
    """What the accessor's ``spectrum`` or ``region`` returned, over ``wavelength_nm`` alone."""
    mean, std = (spectrum[name].values for name in ("reflectance", "reflectance_std"))
    name, nm = str(spectrum.attrs.get("name", "spectrum")), wavelengths_of(spectrum, "The spectrum")
    if "pixel_std" not in spectrum:
        return NamedSpectrum(name, nm, mean, uncertainty=std)
    return of_region(name, nm, mean, std, spectrum["pixel_std"].values, int(spectrum.attrs["used"]))


def of_region(
    name: str, nm: Floats, mean: Floats, spread: Floats | None, pixel_std: Floats | None, used: int
) -> NamedSpectrum:
    """The mean of the ``used`` pixels of a region and how they differ, which a single one does not."""
    return NamedSpectrum(name, nm, mean, None if used == 1 else spread, pixel_std, used)


def export_spectra(
    spectra: Sequence[NamedSpectrum], path: Path, attributes: Mapping[str, Any], *, overwrite: bool = False
) -> Path:
    """Write spectra and where they come from as CSV; raises `StoreError`, also when there are none."""
    require_suffix(path, ".csv")
    if not spectra:
        raise StoreError("A table of spectra needs at least one. Pin a pixel or draw a region first.")
    with (
        staged([path], overwrite=overwrite) as (draft,),
        draft.open("w", newline="", encoding="utf-8") as file,
    ):
        file.writelines(header_lines(provenance_of(attributes)))
        file.writelines(f"# {' '.join(each.name.split())}: {each.where}\n" for each in spectra if each.where)
        file.writelines(map(csv_line, _rows(spectra, "nan")))
    return path


def spectra_as_text(spectra: Sequence[NamedSpectrum]) -> str:
    """The same table with tabs, as spreadsheets take it from the clipboard; what is not there is empty."""
    text = StringIO()
    csv.writer(text, delimiter="\t", lineterminator="\n").writerows(_rows(spectra, ""))
    return text.getvalue()


def _rows(spectra: Sequence[NamedSpectrum], missing: str) -> Iterator[list[str]]:
    head, columns = [WAVELENGTH], []
    for spectrum in spectra:
        # As written, since the same wavelength of two spectra may differ by a rounding.
        labels = [f"{nm:g}" for nm in spectrum.wavelengths_nm.tolist()]
        for title, values in _columns(spectrum):
            head.append(f"{spectrum.name}{title}")
            columns.append(dict(zip(labels, values, strict=True)))
    yield head
    for nm in sorted({nm for column in columns for nm in column}, key=float):
        yield [nm, *(column.get(nm) or missing for column in columns)]


def _columns(spectrum: NamedSpectrum) -> Iterator[tuple[str, list[str]]]:
    scatter, own, nothing = spectrum.deviation, spectrum.uncertainty, np.full(len(spectrum.mean), np.nan)
    if scatter is not None and spectrum.pixels:
        # That of the mean, of which the figure must not be cut.
        known = scatter / np.sqrt(spectrum.pixels)
    else:
        known = nothing if own is None else own
    yield MEAN, [figure_text(*each) for each in zip(spectrum.mean.tolist(), known.tolist(), strict=True)]
    if scatter is not None:
        yield DEVIATION, [deviation_text(each) for each in scatter.tolist()]
    if spectrum.pixels is not None:
        yield COUNT, [str(spectrum.pixels)] * len(spectrum.mean)
    if own is not None:
        yield UNCERTAINTY, [deviation_text(each) for each in own.tolist()]
