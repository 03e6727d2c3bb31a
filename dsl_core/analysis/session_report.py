"""A report of what was looked at: pictures, spectra of marks, their colours, materials, origin."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from dsl_core.analysis.classification import Classification
from dsl_core.analysis.colours import USUAL, Colour, colours_of
from dsl_core.analysis.places import Floats, correlation_of_bands, masks_of_marks, spectra_of_masks
from dsl_core.errors import DecodeError, StoreError
from dsl_core.evaluation.report.curves import spectrum_curve
from dsl_core.evaluation.report.pictures import Key, ReportPicture, png_uri
from dsl_core.evaluation.report.scan_report import (
    ReportContent,
    ReportTable,
    render_report,
    report_content,
)
from dsl_core.io.result.annotations_file import Annotations
from dsl_core.io.staging import write_text
from dsl_core.model.figure import with_std
from dsl_core.words import counted

if TYPE_CHECKING:
    import xarray as xr

#: What a report is written as, by the ending of its file.
ENDINGS = (".html", ".pdf")
#: A library may have more notes than a page can hold.
_MOST_NOTES = 20


def session_content(
    title: str,
    result: xr.Dataset,
    marks: Annotations,
    found: Classification | None = None,
    notes: Sequence[str] = (),
) -> ReportContent:
    """What the report of a result says: its marks with spectra and colours, and materials if given.

    ``notes`` are those on the classes of the materials.
    """
    content = report_content(title, result)
    shape = (result.sizes["y"], result.sizes["x"])
    if "reflectance" in result and (marks.pins or marks.regions):
        masks = masks_of_marks(marks, shape)
        spectra: dict[str, tuple[Floats, Floats]] = {}
        missing = []
        for name, mask in masks.items():
            try:
                spectra |= spectra_of_masks(result, {name: mask})
            except DecodeError as error:
                missing.append(str(error))
        bands = np.asarray(result["wavelength_nm"].values, np.float64)
        curves = [
            spectrum_curve(name, f"{int(masks[name].sum())} px", bands[known], mean[known], std[known])
            for name, (mean, std) in spectra.items()
            for known in (np.isfinite(mean),)
            if known.any()
        ]
        colours: list[Colour] = []
        together = correlation_of_bands(result)
        for name, spectrum in spectra.items():
            try:
                colours += colours_of({name: spectrum}, bands, correlation=together)
            except DecodeError as error:
                missing.append(str(error))
        colours.sort(key=lambda each: USUAL.index(each.light))
        tables = [colour_table(colours)] if colours else []
        centres = (np.argwhere(masks[name]).mean(0).round() for name in spectra)
        places = [(int(y), int(x)) for y, x in centres]
        content = replace(
            content,
            curves=curves,
            tables=tables,
            places=places,
            summary=" ".join(dict.fromkeys(missing)),
            has_samples=False,
        )
    if found is not None:
        picture, table = _materials(found, notes)
        content = replace(content, more=[picture], tables=[table, *content.tables])
    return content


def colour_table(colours: list[Colour]) -> ReportTable:
    """Colours as a table: a line for each mark and light."""
    rows: list[tuple[str, ...]] = []
    for each in colours:
        lab = [_figure(*figure) for figure in zip(each.lab, each.lab_std, strict=True)]
        difference = "" if each.delta_e is None else _figure(each.delta_e, each.delta_e_std)
        rows.append((each.name, each.light, *lab, difference))
    heads: tuple[str, ...] = ("Mark", "Light", "L*", "a*", "b*", "ΔE00")
    if not any(row[-1] for row in rows):
        heads, rows = heads[:-1], [row[:-1] for row in rows]
    note = "CIE 1931 observer, relative to the perfect diffuser; ± one deviation."
    return ReportTable("Colours", heads, tuple(tuple(row) for row in rows), note)


def _figure(value: float, std: float | None) -> str:
    """A figure with its deviation, if that is known."""
    return with_std(value, std, 2) if std and math.isfinite(std) else f"{value:.2f}"


def _materials(found: Classification, notes: Sequence[str]) -> tuple[ReportPicture, ReportTable]:
    shown = found.shown
    colours = shown.palette()
    table = np.zeros((len(colours), 4), np.uint8)
    for value, colour in enumerate(colours):
        table[value] = (*bytes.fromhex(colour[1:]), 255 if value else 0)
    keys = tuple(Key(colours[row.value], row.label, row.share) for row in found.rows if row.share)
    picture = ReportPicture("Materials", f"by {found.method}", png_uri(table[shown.values]), keys=keys)
    rows = tuple(
        (
            row.label,
            row.pixels_text,
            "–" if row.share is None else f"{100 * row.share:.1f} %",
            row.area_text,
        )
        for row in found.rows
    )
    more = (f"And {counted(len(notes) - _MOST_NOTES, 'more note')}.",) if len(notes) > _MOST_NOTES else ()
    note = " ".join((f"By {found.method}; ± one deviation.", *found.notes, *notes[:_MOST_NOTES], *more))
    return picture, ReportTable("Materials", ("Material", "Pixels", "Share", "Area, mm²"), rows, note)


def write_report(content: ReportContent, path: Path, *, overwrite: bool = False) -> Path:
    """Write a report as HTML page or PDF, as the ending of the path says; raises `StoreError`."""
    if path.suffix.lower() not in ENDINGS:
        raise StoreError(f"{path.name!r} does not end in {' or '.join(ENDINGS)}. Add the ending to the name.")
    if path.suffix.lower() == ".html":
        return write_text(path, lambda: render_report(content), overwrite=overwrite)
    from dsl_core.analysis.pdf_report import write_pdf

    return write_pdf(content, path, overwrite=overwrite)
