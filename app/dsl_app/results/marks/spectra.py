"""The spectra of marks: of a reference, of the pixels of a region, and of what is shown for export. No Qt."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from dsl_app.results.state import Mark
from dsl_app.shared.spectrum import Spectrum
from dsl_core.io.result.result_arrays import ResultArrays
from dsl_core.model.spectral import SpectralCurve
from dsl_core.progress import Progress

if TYPE_CHECKING:
    from dsl_core.io.export.spectra import NamedSpectrum

#: The spectrum of a mark that has none, or not yet.
NO_SPECTRUM = Spectrum(np.empty(0), np.empty(0))


def mark_of_reference(name: str, colour: int, path: Path, curve: SpectralCurve, entry: str = "") -> Mark:
    """A reference with its spectrum."""
    spectrum = Spectrum(np.array(curve.wavelengths_nm), np.array(curve.values))
    return Mark("reference", name, colour, spectrum, file=path, entry=entry, curve=curve)


def fill_region(draft: Mark, result: ResultArrays, progress: Progress) -> Mark:
    """A region with the mean and standard deviation of its pixels; of one pixel, that stated for it."""
    from dsl_core.evaluation.marks import mask_of_outline, mask_of_runs, region_spectrum

    progress.report("mean of a region", 0, 1)
    shape = result.shape
    mask = mask_of_runs(draft.runs, shape) if draft.runs else mask_of_outline(draft.outline_px, shape)
    found = region_spectrum(result["reflectance"], result["reflectance_std"], result["data_share"], mask)
    spectrum = Spectrum(result.wavelengths_nm, found.mean, found.spread, found.data_share, sigmas=1.0)
    return replace(draft, spectrum=spectrum, pixels=found.pixels, used=found.used, pixel_std=found.pixel_std)


def shown_spectra(marks: Iterable[Mark], result: ResultArrays | None) -> list[NamedSpectrum]:
    """The spectra of the marks of a result that are shown and have one."""
    return [_named_spectrum(mark, result) for mark in marks if mark.shown and not mark.trouble]


def _named_spectrum(mark: Mark, result: ResultArrays | None) -> NamedSpectrum:
    from dsl_core.io.export.spectra import NamedSpectrum, of_region

    nm, mean, std = mark.spectrum.nm, mark.spectrum.mean, mark.spectrum.std
    match mark.kind:
        case "pin":
            at = mark.pixel
            at = at if at is None or result is None else result.in_picture(at)
            where = "" if at is None else f"pixel at column {at[0]}, row {at[1]}, counted from 0"
            return NamedSpectrum(mark.name, nm, mean, uncertainty=std, pixels=1, where=where)
        case "region":
            return of_region(mark.name, nm, mean, std, mark.pixel_std, mark.used)
        case "reference":
            return NamedSpectrum(mark.name, nm, mean)
