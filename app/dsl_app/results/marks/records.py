"""Marks as they are kept on disk, and the spectra that they stand for. No Qt."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np

from dsl_app.results.state import Mark
from dsl_app.shared.spectrum import Spectrum, spectrum_of_pixel
from dsl_core.errors import DslError
from dsl_core.io.result.annotations_file import Annotations, PinRecord, ReferenceRecord, RegionRecord
from dsl_core.io.result.result_arrays import ResultArrays
from dsl_core.io.spectra.reference_file import read_reference
from dsl_core.model.spectral import SpectralCurve
from dsl_core.progress import Progress

#: The spectrum of a region whose mean is not computed yet.
NOTHING = Spectrum(np.empty(0), np.empty(0))


def mark_of_reference(name: str, colour: int, path: Path, curve: SpectralCurve, entry: str = "") -> Mark:
    """A reference with its spectrum."""
    spectrum = Spectrum(np.array(curve.wavelengths_nm), np.array(curve.values))
    return Mark("reference", name, colour, spectrum, file=path, entry=entry, curve=curve)


def fill_region(draft: Mark, result: ResultArrays, progress: Progress) -> Mark:
    """A region with the mean and deviation of its pixels."""
    from dsl_core.evaluation.marks import mask_of_outline, mask_of_runs, region_spectrum

    progress.report("mean of a region", 0, 1)
    shape = result.shape
    mask = mask_of_runs(draft.runs, shape) if draft.runs else mask_of_outline(draft.outline_px, shape)
    found = region_spectrum(result["reflectance"], result["reflectance_std"], result["data_share"], mask)
    spectrum = Spectrum(result.wavelengths_nm, found.mean, found.deviation, found.data_share, sigmas=1.0)
    return replace(draft, spectrum=spectrum, pixels=found.pixels, used=found.used, pixel_std=found.pixel_std)


def marks_of(kept: Annotations, result: ResultArrays, progress: Progress) -> tuple[Mark, ...]:
    """Kept marks with their spectra; where there is none, a mark says why, so that it stays in the file."""
    regions = tuple(_kept_region(region, result, progress) for region in kept.regions)
    return (
        *(_kept_pin(pin, result) for pin in kept.pins),
        *regions,
        *(_kept_reference(reference) for reference in kept.references),
    )


def _kept_pin(pin: PinRecord, result: ResultArrays) -> Mark:
    spectrum = spectrum_of_pixel(result, pin.pixel)
    trouble = "" if spectrum is not None else f"Pixel {pin.pixel[0]}, {pin.pixel[1]} has no spectrum here."
    return Mark("pin", pin.name, pin.colour, spectrum or NOTHING, pin.shown, pixel=pin.pixel, trouble=trouble)


def _kept_region(region: RegionRecord, result: ResultArrays, progress: Progress) -> Mark:
    draft = Mark("region", region.name, region.colour, NOTHING, region.shown)
    draft = replace(draft, outline_px=region.outline_px, runs=region.runs)
    filled = fill_region(draft, result, progress) if result.has_spectra else draft
    return filled if filled.used else replace(draft, trouble="No pixel of this region has a spectrum here.")


def _kept_reference(reference: ReferenceRecord) -> Mark:
    path = Path(reference.file)
    try:
        curve = read_reference(path, reference.entry)
        made = mark_of_reference(reference.name, reference.colour, path, curve, reference.entry)
    except DslError as error:
        made = Mark("reference", reference.name, reference.colour, NOTHING, file=path, trouble=str(error))
        made = replace(made, entry=reference.entry)
    return replace(made, shown=reference.shown)


def annotations_of(marks: Iterable[Mark]) -> Annotations:
    """Marks as they are kept."""
    pins, regions, references = [], [], []
    for mark in marks:
        name, colour, shown = mark.name, mark.colour, mark.shown
        if mark.kind == "pin" and mark.pixel is not None:
            pins.append(PinRecord(name=name, pixel=mark.pixel, colour=colour, shown=shown))
        elif mark.kind == "region":
            regions.append(
                RegionRecord(
                    name=name, outline_px=mark.outline_px, runs=mark.runs, colour=colour, shown=shown
                )
            )
        elif mark.file is not None:
            references.append(
                ReferenceRecord(name=name, file=str(mark.file), entry=mark.entry, colour=colour, shown=shown)
            )
    return Annotations(pins=tuple(pins), regions=tuple(regions), references=tuple(references))
