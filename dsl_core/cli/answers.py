"""Commands for first answers from a result: which material, of which area, of which colour."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from dsl_core.cli.options import Force, Json, parse_place, parse_span
from dsl_core.cli.output import Output
from dsl_core.errors import DecodeError, PlanError
from dsl_core.io.staging import check_targets

if TYPE_CHECKING:
    import numpy as np
    import xarray as xr
    from numpy.typing import NDArray

    from dsl_core.analysis.classes import SpectralClass
    from dsl_core.analysis.classification import Classification
    from dsl_core.io.export.spectra import NamedSpectrum
    from dsl_core.progress import Progress

Result = Annotated[Path, typer.Argument(metavar="RESULT.zarr", help="A result of 'reconstruct'.")]
Pins = Annotated[bool, typer.Option("--pins", help="Places are the marked pins and regions.")]
Places = Annotated[
    list[str],
    typer.Option("--at", help="A place, as NAME=X,Y or NAME=X,Y,WIDTH,HEIGHT; can be repeated."),
]
#: So many notes on a library are printed; the rest is counted.
_MOST_NOTES = 6
#: From this share of "none of these" on, the library itself may be what does not fit.
_MOSTLY = 0.8


def classify(
    path: Result,
    library: Annotated[
        list[Path],
        typer.Option("--library", "-l", help="File or folder of spectra; may be repeated."),
    ] = [],  # noqa: B006 - typer reads it, nobody changes it
    group: Annotated[
        str,
        typer.Option(
            "--group",
            help="What makes a class of the library: auto, name, folder, file, none, or a CSV file with the"
            " columns name and group.",
        ),
    ] = "auto",
    library_error: Annotated[
        float,
        typer.Option(
            "--library-error",
            help="Standard deviation of the library's spectra as a share of reflectance, such as 0.02, where"
            " another instrument measured them.",
        ),
    ] = 0.0,
    pins: Annotated[
        bool, typer.Option("--pins", help="Classes are the pins and regions marked on the result.")
    ] = False,
    at: Annotated[
        list[str],
        typer.Option("--at", help="A known material, as NAME=X,Y or NAME=X,Y,WIDTH,HEIGHT; may be repeated."),
    ] = [],  # noqa: B006
    measure: Annotated[
        str,
        typer.Option("--by", help="probability (from the stated deviations), angle or rmse."),
    ] = "probability",
    worst: Annotated[
        float | None,
        typer.Option(
            "--worst",
            help="Share of a class's own pixels that may become 'none of these' (probability; usual 0.01),"
            " largest angle in rad (0.1), or largest difference (0.03).",
        ),
    ] = None,
    margin: Annotated[
        float | None,
        typer.Option(
            "--margin",
            help="Least probability of the class (usual 0.95), or by which share the second class must be"
            " worse (0.1).",
        ),
    ] = None,
    free: Annotated[
        bool, typer.Option("--free-brightness", help="Compare the shape of spectra, not their level.")
    ] = False,
    span: Annotated[
        str | None, typer.Option("--range", help="START:STOP in nm, to use some of the bands.")
    ] = None,
    outputs: Annotated[
        list[Path],
        typer.Option(
            "--output",
            "-o",
            help="NAME.hdr (ENVI classification), NAME.ply (points with their class) or NAME.csv (areas);"
            " may be repeated.",
        ),
    ] = [],  # noqa: B006
    force: Force = False,
    json: Json = False,
) -> None:
    """Name the material of every pixel, or say 'none of these', with areas in pixels and mm2."""
    from dsl_core.analysis.classification import (
        ENDINGS,
        classify_result,
        with_known_bands,
        within_nm,
        write_classification,
    )
    from dsl_core.analysis.classify import Limits, Measure
    from dsl_core.io.result.result_file import load_result

    output = Output(json)
    if measure not in (names := [each.value for each in Measure]):
        raise PlanError(f"--by must be one of {', '.join(names)}, not {measure!r}.")
    if library_error and not library:
        raise PlanError("--library-error is that of spectra from a library. Name it with --library.")
    wrong = [str(each) for each in outputs if each.suffix.lower() not in ENDINGS]
    if wrong:
        raise PlanError(f"{wrong[0]} must end in {', '.join(ENDINGS)}: choose one for --output.")
    check_targets(outputs, overwrite=force)
    limits = Limits.chosen(Measure(measure), worst, margin)
    if not (library or pins or at):
        raise PlanError("Say what to look for: --library FOLDER, --pins, or --at NAME=X,Y.")
    _check_places(at)
    result = load_result(path)
    if span is not None:
        result = within_nm(result, *parse_span("--range", span))
    result, missing = with_known_bands(result)
    with output.progress() as progress:
        classes, notes = _classes(path, result, library, library_error, group, pins, at, progress)
        found = classify_result(
            result, classes, Measure(measure), limits, "free" if free else "stated", progress
        )
        files = [
            file for each in outputs for file in write_classification(result, found, each, overwrite=force)
        ]
    notes = [*found.notes, *missing, *notes]
    for note in notes[:_MOST_NOTES]:
        output.say(note)
    if len(notes) > _MOST_NOTES:
        output.say(f"... and {len(notes) - _MOST_NOTES} more notes on the library (see --json).")
    shown = [row for row in found.rows if row.pixels]
    output.table(
        ("class", "pixels", "share", "area (mm2)"),
        [(row.label, row.pixels_text, row.share_text or "-", row.area_text) for row in shown],
    )
    output.say(f"By {found.method}.")
    if library and not library_error and _are_mostly_none(found):
        output.say(
            "Few pixels fit any class. Spectra that another instrument measured differ by some percent: state"
            " that with --library-error 0.02, or compare shapes with --free-brightness."
        )
    if files:
        output.say(f"Written: {', '.join(str(file) for file in files)}")
    palette = found.shown.palette()
    output.put(
        result=path,
        method=found.method,
        notes=list(notes),
        classes=[row.__dict__ | {"colour": palette[row.value]} for row in found.rows],
        files=[str(file) for file in files],
    )
    output.finish()


def _are_mostly_none(found: Classification) -> bool:
    """Whether most judged pixels are none of the classes, by the probability."""
    none = next(row.share for row in found.rows if row.value == len(found.shown.labels) - 2)
    return found.scores.measure.value == "probability" and (none or 0.0) > _MOSTLY


def _classes(
    path: Path,
    result: xr.Dataset,
    library: Sequence[Path],
    library_error: float,
    group: str,
    pins: bool,
    at: Sequence[str],
    progress: Progress,
) -> tuple[list[SpectralClass], list[str]]:
    """The classes that the options name, and notes on the library."""
    from dsl_core.analysis.classes import classes_of_library, known_classes, marked_by
    from dsl_core.analysis.classification import classes_of_masks
    from dsl_core.analysis.library import read_library
    from dsl_core.analysis.places import colours_of_marks, require_spectra
    from dsl_core.io.result.annotations_file import load_annotations
    from dsl_core.model.attributes import stated_band_width_nm

    require_spectra(result)
    classes: list[SpectralClass] = []
    notes: list[str] = []
    if library:
        table = Path(group) if group.lower().endswith(".csv") else None
        read = read_library(library, "auto" if table else group, table, progress)
        nm = result["wavelength_nm"].values
        width_nm = stated_band_width_nm(result.attrs, nm)
        found, left_out = classes_of_library(read, nm, library_error, width_nm)
        classes += found
        notes += [*read.notes, *left_out]
    masks = _masks(path, result, pins, at)
    if masks:
        classes += classes_of_masks(result, masks)
    if pins:
        classes = list(marked_by(classes, colours_of_marks(load_annotations(path))))
    known, doubts = known_classes(classes, result.get("reflectance_std"))
    return list(known), [*doubts, *notes]


def spectra(
    path: Result,
    pins: Pins = False,
    at: Places = [],  # noqa: B006
    table: Annotated[Path | None, typer.Option("--output", "-o", help="NAME.csv to write.")] = None,
    force: Force = False,
    json: Json = False,
) -> None:
    """Spectra of places, a row for each band: mean reflectance and what a pixel of the place is uncertain by.

    The CSV file also has the number of pixels of each place and how much these differ from each other.
    """
    from dsl_core.analysis.places import require_spectra
    from dsl_core.io.export.spectra import export_spectra
    from dsl_core.io.result.result_file import load_result

    output = Output(json)
    _require_places(pins, at)
    check_targets([] if table is None else [table], overwrite=force)
    result = load_result(path)
    require_spectra(result)
    masks = _masks(path, result, pins, at)
    found = {name: _named_spectrum(result, name, mask) for name, mask in masks.items()}
    nm = result["wavelength_nm"].values
    rows = zip(*map(_cells, found.values()), strict=True)
    output.table(("nm", *found), [(f"{centre:g}", *row) for centre, row in zip(nm, rows, strict=True)])
    if table is not None:
        attributes = {str(name): value for name, value in result.attrs.items()}
        output.say(f"Written: {export_spectra([*found.values()], table, attributes, overwrite=force)}")
    listed = {
        name: {"pixels": each.pixels, "reflectance": each.mean.tolist(), "reflectance_std": _stds(each)}
        for name, each in found.items()
    }
    output.put(result=path, wavelength_nm=nm.tolist(), spectra=listed)
    output.finish()


def _named_spectrum(result: xr.Dataset, name: str, mask: NDArray[np.bool_]) -> NamedSpectrum:
    """The mean spectrum of a place; raises `DecodeError` where no pixel has one."""
    from dataclasses import replace

    import numpy as np

    from dsl_core.analysis.places import spectra_of_masks
    from dsl_core.api.accessor import ResultAccessor
    from dsl_core.io.export.spectra import NamedSpectrum, named_spectrum

    if np.count_nonzero(mask) > 1:
        return replace(named_spectrum(ResultAccessor(result).region(mask)), name=name)
    mean, std = spectra_of_masks(result, {name: mask})[name]
    (row, column), nm = np.argwhere(mask)[0], result["wavelength_nm"].values
    where = f"pixel at column {result['x'].values[column]}, row {result['y'].values[row]}, counted from 0"
    return NamedSpectrum(name, nm, mean, uncertainty=std, pixels=1, where=where)


def _stds(spectrum: NamedSpectrum) -> list[float]:
    """What a pixel of a place is uncertain by, at each band."""
    return [] if spectrum.uncertainty is None else spectrum.uncertainty.tolist()


def _cells(spectrum: NamedSpectrum) -> list[str]:
    from dsl_core.model.figure import with_std

    pairs = zip(spectrum.mean, _stds(spectrum), strict=True)
    return ["-" if mean != mean else with_std(mean, std, 4) for mean, std in pairs]


def colours(
    path: Result,
    pins: Pins = False,
    at: Places = [],  # noqa: B006
    light: Annotated[
        list[str], typer.Option("--light", help="A CIE illuminant, such as A, D50, D65, FL11 or LED-B3.")
    ] = [],  # noqa: B006
    reference: Annotated[
        str | None, typer.Option("--to", help="Place that colour differences (CIEDE2000) are to.")
    ] = None,
    table: Annotated[Path | None, typer.Option("--output", "-o", help="NAME.csv to write.")] = None,
    force: Force = False,
    json: Json = False,
) -> None:
    """Colours of places under several lights: L*a*b* and CIEDE2000, each with its deviation."""
    from dsl_core.analysis.colours import HEADER, USUAL, colours_of
    from dsl_core.analysis.places import correlation_of_bands, spectra_of_masks
    from dsl_core.io.export.table import export_table
    from dsl_core.io.result.result_file import load_result

    output = Output(json)
    _require_places(pins, at)
    check_targets([] if table is None else [table], overwrite=force)
    result = load_result(path)
    spectra = spectra_of_masks(result, _masks(path, result, pins, at))
    nm, together = result["wavelength_nm"].values, correlation_of_bands(result)
    found = colours_of(spectra, nm, light or USUAL, reference, together)
    rows = [each.cells for each in found]
    shown = [[f"{v:.2f}" if isinstance(v, float) else v or "" for v in row] for row in rows]
    output.table(HEADER, shown)
    if table is not None:
        notes = {"colours": "CIE 1931 observer, relative to the perfect diffuser"}
        export_table(result, HEADER, rows, notes, table, overwrite=force)
        output.say(f"Written: {table}")
    output.put(result=path, colours=[dict(zip(HEADER, row, strict=True)) for row in rows])
    output.finish()


def report(
    path: Result,
    outputs: Annotated[
        list[Path],
        typer.Option("--output", "-o", help="NAME.html or NAME.pdf; the default is RESULT_report.html."),
    ] = [],  # noqa: B006
    library: Annotated[
        list[Path], typer.Option("--library", "-l", help="Spectra to name materials by; may be repeated.")
    ] = [],  # noqa: B006
    materials: Annotated[
        bool, typer.Option("--materials", help="Name materials by the marked pins and regions.")
    ] = False,
    force: Force = False,
    json: Json = False,
) -> None:
    """Write pictures, spectra and colours of marks, materials and origin of a result as one document."""
    from dsl_core.analysis.classification import classify_result, with_known_bands
    from dsl_core.analysis.session_report import ENDINGS, session_content, write_report
    from dsl_core.io.neighbours import beside_result, stem_of
    from dsl_core.io.result.annotations_file import load_annotations
    from dsl_core.io.result.result_file import load_result

    output = Output(json)
    targets = list(outputs) or [beside_result(path, "_report.html")]
    wrong = [str(each) for each in targets if each.suffix.lower() not in ENDINGS]
    if wrong:
        raise PlanError(f"{wrong[0]} must end in {' or '.join(ENDINGS)}: choose one for --output.")
    check_targets(targets, overwrite=force)
    result, found, notes = load_result(path), None, list[str]()
    with output.progress() as progress:
        if library or materials:
            known, missing = with_known_bands(result)
            classes, notes = _classes(path, known, library, 0.0, "auto", materials, (), progress)
            found, notes = classify_result(known, classes, progress=progress), [*missing, *notes]
        content = session_content(stem_of(path), result, load_annotations(path), found, notes)
        for target in targets:
            write_report(content, target, overwrite=force)
    output.say(f"Written: {', '.join(str(target) for target in targets)}")
    output.put(files=[str(target) for target in targets])
    output.finish()


def _require_places(pins: bool, at: Sequence[str]) -> None:
    """Raise `PlanError` where no option names a place."""
    if not (pins or at):
        raise PlanError("Say which places: --pins, or --at NAME=X,Y.")
    _check_places(at)


def _check_places(at: Sequence[str]) -> None:
    """Raise `PlanError` for a place that cannot be read, before a result is, which takes long."""
    for text in at:
        parse_place("--at", text)


def _masks(path: Path, result: xr.Dataset, pins: bool, at: Sequence[str]) -> dict[str, NDArray[np.bool_]]:
    """The places that the options name; raises `DecodeError` where they are to be marked and none is."""
    from dsl_core.analysis.places import masks_of_marks
    from dsl_core.api.places import place_mask
    from dsl_core.io.result.annotations_file import load_annotations

    masks: dict[str, NDArray[np.bool_]] = {}
    if pins:
        masks |= masks_of_marks(load_annotations(path), (result.sizes["y"], result.sizes["x"]))
    for text in at:
        name, place = parse_place("--at", text)
        mask = place_mask(result, place, name)
        masks[name] = masks[name] | mask if name in masks else mask
    if pins and not masks:
        raise DecodeError("Nothing is marked on the result. Pin pixels or mark regions in the window first.")
    return masks
