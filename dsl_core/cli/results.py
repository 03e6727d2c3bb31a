"""Commands for results: reconstruct, evaluate, export, mesh."""

from __future__ import annotations

from json import loads
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from dsl_core.cli.options import (
    CalibrationName,
    Force,
    Json,
    OverrideCalibration,
    RigOptions,
    parse_bands,
    parse_options,
    parse_pixels,
    tab_rigs,
)
from dsl_core.cli.output import Output
from dsl_core.errors import PlanError
from dsl_core.evaluation.cost import StageTimer
from dsl_core.io.staging import check_targets
from dsl_core.reconstruction.torch_device import DEVICES, torch_device
from dsl_core.words import counted

if TYPE_CHECKING:
    import xarray as xr

    from dsl_core.evaluation.summary import Evaluation

Result = Annotated[Path, typer.Argument(metavar="RESULT.zarr", help="A result of 'reconstruct'.")]


def reconstruct(
    scan: Annotated[Path, typer.Argument(metavar="SCAN.dsl", help="A complete scan.")],
    target: Annotated[
        Path | None, typer.Option("--output", "-o", help="Folder to write; the default is SCAN.zarr.")
    ] = None,
    calibration: CalibrationName = None,
    override: OverrideCalibration = False,
    bands: Annotated[str, typer.Option(help="START:STOP:STEP in nm.")] = "430:660:5",
    model: Annotated[str, typer.Option(help="Correspondence: auto, grating, hybrid or grid.")] = "auto",
    solver: Annotated[str, typer.Option(help="best, published, nearest-line or colour-basis.")] = "best",
    refine: Annotated[
        bool, typer.Option("--refine/--no-refine", help="Find columns to a fraction of a pixel.")
    ] = True,
    depth_only: Annotated[bool, typer.Option("--depth-only", help="Leave out the spectra.")] = False,
    as_calibrated: Annotated[
        bool, typer.Option("--as-calibrated", help="Correct nothing by what the scan itself shows.")
    ] = False,
    device: Annotated[str, typer.Option(help="cpu, cuda, or auto: cuda if available.")] = "cpu",
    force: Force = False,
    json: Json = False,
) -> None:
    """Turn frames into depth, points, normals, reflectance and their uncertainty."""
    from dsl_core.io.calibration_library import load_calibration
    from dsl_core.io.result.result_file import RESULT_FOLDER, load_result
    from dsl_core.io.scan.manifest import read_manifest
    from dsl_core.model.options import MODELS, SOLVERS, names
    from dsl_core.pipeline import Options
    from dsl_core.workflows.scans import DOUBTS, NOT_JUDGED, reconstruct_to

    output, timer = Output(json), StageTimer()
    _require_one_of("--model", model, names(MODELS))
    _require_one_of("--solver", solver, names(SOLVERS))
    _require_one_of("--device", device, DEVICES)
    grid = parse_bands(bands)
    if target is None:
        target = scan.with_suffix(".zarr")
        if target.exists():
            read_manifest(scan)  # that it is no scan is told before that its result exists
    check_targets([target], overwrite=force, kind=RESULT_FOLDER)
    rig = load_calibration(calibration) if calibration else None
    if rig is None and _tells_columns_only(scan):
        _decode(output, scan, target, force)
        return
    if _is_import(scan):
        # Pictures of other programs have no frames of spectral patterns.
        depth_only = True
    options = Options(
        grid,
        model,
        refine,
        not depth_only,
        torch_device(device),
        solver=solver,
        as_calibrated=as_calibrated,
    )
    with output.progress() as progress:
        reconstruct_to(
            target, scan, rig, options, progress, timer, override_calibration=override, overwrite=force
        )
    result = load_result(target)
    output.costs(timer.stages)
    doubts = loads(result.attrs.get(DOUBTS, "[]"))
    for sentence in doubts:
        output.say(f"{sentence} The result may be wrong; scan again, or see 'dsl-scan info --verify'.")
    not_judged = result.attrs.get(NOT_JUDGED, "")
    if not_judged:
        output.say(f"{not_judged} pictures show too little to be compared with their pattern.")
    share = coverage(result)
    print_fit(output, result)
    output.say(f"{share:.1%} of the pixels have a depth. The result is saved in {target}")
    output.put(result=target, pixels_with_depth=share, wrong_pictures=doubts, pictures_not_judged=not_judged)
    output.finish()


def _is_import(scan: Path) -> bool:
    from dsl_core.io.scan.folder import ScanReader
    from dsl_core.workflows.captures import is_import

    return is_import(ScanReader(scan))


def _tells_columns_only(scan: Path) -> bool:
    """Whether a scan was made of another program's pictures, and nobody said where its devices stand."""
    from dsl_core.io.scan.folder import ScanReader

    return _is_import(scan) and ScanReader(scan).calibration is None


def _decode(output: Output, scan: Path, target: Path, force: bool) -> None:
    from dsl_core.io.result.result_file import save_result
    from dsl_core.workflows.captures import NO_DEPTH, decode_scan

    with output.progress() as progress:
        result = decode_scan(scan, progress)
        save_result(result, target, overwrite=force)
    share = float(result["column_px"].notnull().mean())
    output.say(str(result.attrs[NO_DEPTH]))
    told, what = share, "column"
    if share == 0 and "row_px" in result:
        told, what = float(result["row_px"].notnull().mean()), "row"
    output.say(f"{100 * told:.1f} % of the pixels have a {what}. The result is saved in {target}")
    output.put(
        result=target, pixels_with_depth=0.0, pixels_with_column=share, no_depth=result.attrs[NO_DEPTH]
    )
    output.finish()


def evaluate(
    path: Result,
    truth_rig: Annotated[
        str | None,
        typer.Option(help="Rig that provides the truth; the default is the scan's.", autocompletion=tab_rigs),
    ] = None,
    option: RigOptions = [],  # noqa: B006 - typer reads it, nobody changes it
    report: Annotated[
        Path | None, typer.Option("--report", "-o", help="HTML page to write; the default is RESULT.html.")
    ] = None,
    force: Force = False,
    json: Json = False,
) -> None:
    """Compare a result with the known truth, in figures and in one self-contained HTML page."""
    from dsl_core import pipeline
    from dsl_core.evaluation.report.scan_report import report_content
    from dsl_core.evaluation.verdict import deviations, figures
    from dsl_core.io.result.result_file import load_result, read_attributes
    from dsl_core.workflows import scans

    if report is None:
        read_attributes(path)
        report = path.with_suffix(".html")
    output = Output(json)
    check_targets([report], overwrite=force)
    result = load_result(path)
    truth = scans.truth_of(result, truth_rig, parse_options(option))
    evaluation = pipeline.evaluate(result, truth)
    pipeline.write_report(report_content(path.stem, result, truth, evaluation), report, force)
    print_figures(output, evaluation)
    print_fit(output, result)
    output.say(f"The report is saved in {report}")
    output.put(report=report, figures=figures(evaluation), deviations=deviations(evaluation))
    output.finish()


def _forms() -> tuple[str, ...]:
    from dsl_core.io.export import formats

    return (*sorted(formats()), "dataset", "calibration")


def tab_formats(incomplete: str) -> list[str]:
    """Formats of exports for the Tab key."""
    return [form for form in _forms() if form.startswith(incomplete)]


def export(
    path: Annotated[
        Path,
        typer.Argument(
            metavar="SOURCE",
            help="A result; a scan for 'dataset'; a rig's file, a scan or a name for 'calibration'.",
        ),
    ],
    form: Annotated[
        str,
        typer.Argument(
            metavar="FORMAT",
            help="ply, envi, exr, csv, png, tiff, npy; glb, obj, stl or mesh for the surface; dataset or"
            " calibration.",
            autocompletion=tab_formats,
        ),
    ],
    target: Annotated[Path, typer.Argument(metavar="TARGET", help="File or folder to write.")],
    pixel: Annotated[list[str], typer.Option(help="x,y of a pixel, for csv only; may be repeated.")] = [],  # noqa: B006
    force: Force = False,
    json: Json = False,
) -> None:
    """Export a result for other programs, or a scan or rig in the published layout."""
    output = Output(json)
    _say_written(output, _export(output, path, form, target, parse_pixels(pixel), force))


def mesh(
    path: Result,
    target: Annotated[
        Path, typer.Argument(metavar="TARGET", help="File to write: .glb, .obj, .ply or .stl.")
    ],
    every: Annotated[
        int, typer.Option(help="Use each N-th row and column only, for a smaller file.", min=1)
    ] = 1,
    force: Force = False,
    json: Json = False,
) -> None:
    """Write the surface of a result as a mesh, cut at depth jumps, with its colours as texture.

    .glb is glTF in metres with its texture, .obj comes with .mtl and .png, .ply colours and spectra at
    each vertex, .stl triangles only; lengths of the last three are in mm.
    """
    from dsl_core.io.export import export_mesh
    from dsl_core.io.result.result_file import load_result

    output = Output(json)
    _say_written(output, export_mesh(load_result(path), target, overwrite=force, every=every))


def _say_written(output: Output, files: list[Path]) -> None:
    shown = [str(file) for file in files[:10]] + (["..."] if len(files) > 10 else [])
    output.say(f"Written ({counted(len(files), 'file')}): {', '.join(shown)}")
    output.put(files=[str(file) for file in files])
    output.finish()


def _export(
    output: Output, path: Path, form: str, target: Path, pixels: list[tuple[int, int]], force: bool
) -> list[Path]:
    from dsl_core.io.calibration_library import load_calibration
    from dsl_core.io.export import export as export_result
    from dsl_core.io.export import export_csv
    from dsl_core.io.published.calibration import export_calibration
    from dsl_core.io.result.result_file import load_result
    from dsl_core.io.scan.folder import ScanReader
    from dsl_core.workflows import exchange
    from dsl_core.workflows.scans import calibration_of

    form = form.lower()
    if form not in _forms():
        raise PlanError(f"There is no export format {form!r}. Choose one of {', '.join(_forms())}.")
    if form not in ("dataset", "calibration"):
        check_targets([target], overwrite=True)  # what else a format writes, it checks itself
    if pixels and form != "csv":
        raise PlanError(f"--pixel is for csv only; {form} contains all pixels. Leave it out.")
    if form == "dataset":
        with output.progress() as progress:
            return exchange.export_scan(path, target, force, progress)
    if form == "calibration":
        is_scan = path.is_dir()
        rig = calibration_of(ScanReader(path)) if is_scan else load_calibration(str(path))
        return export_calibration(rig, target, overwrite=force)
    if form == "csv":
        return export_csv(load_result(path), target, overwrite=force, pixels=pixels)
    return export_result(load_result(path), target, form, overwrite=force)


def coverage(result: xr.Dataset) -> float:
    """Share of the pixels that have a depth."""
    return float(result["depth_mm"].notnull().mean())


def print_figures(output: Output, evaluation: Evaluation) -> None:
    """Every figure of an evaluation, one per line."""
    from dsl_core.evaluation.verdict import verdicts

    output.table(("figure", "value", "unit"), [(v.figure, v.words, v.unit) for v in verdicts(evaluation)])


def print_fit(output: Output, result: xr.Dataset) -> None:
    """What the result says about its calibration and the fit of its model; nothing if it does not say."""
    from dsl_core.model.calibration.accepted import read_missed
    from dsl_core.model.fit import Fit

    attributes = {str(name): value for name, value in result.attrs.items()}
    fit, missed = Fit.read(attributes), read_missed(attributes)
    for sentence in missed:
        output.say(sentence)
    if missed:
        output.put(calibration_missed=missed)
    if fit is not None:
        output.say(fit.words)
        output.put(fit={"words": fit.words, "findings": [f.model_dump() for f in fit.findings]})


def _require_one_of(option: str, given: str, choices: tuple[str, ...]) -> None:
    if given not in choices:
        raise PlanError(f"{option} must be one of {', '.join(choices)}, not {given!r}.")
