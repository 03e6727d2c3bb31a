"""Commands for results: reconstruct, evaluate, export, mesh."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from dsl_core.cli.options import (
    Force,
    Json,
    RigOptions,
    html_page,
    parse_options,
    parse_pixels,
    tab_rigs,
)
from dsl_core.cli.output import Output
from dsl_core.errors import PlanError
from dsl_core.io import MANIFEST_NAME
from dsl_core.io.staging import check_targets
from dsl_core.words import counted

if TYPE_CHECKING:
    import xarray as xr

    from dsl_core.evaluation.summary import Evaluation

Result = Annotated[Path, typer.Argument(metavar="RESULT.zarr", help="A result of 'reconstruct'.")]


def evaluate(
    path: Result,
    truth_rig: Annotated[
        str | None,
        typer.Option(help="Rig that provides the truth; the default is the scan's.", autocompletion=tab_rigs),
    ] = None,
    option: RigOptions = [],  # noqa: B006 - typer reads it, nobody changes it
    report: Annotated[
        Path | None,
        typer.Option(
            "--report", "-o", callback=html_page, help="HTML page to write; the default is RESULT.html."
        ),
    ] = None,
    force: Force = False,
    json: Json = False,
) -> None:
    """Compare a result with the known truth, in figures and in one self-contained HTML page."""
    from dsl_core import pipeline
    from dsl_core.evaluation.report.scan_report import report_content
    from dsl_core.evaluation.verdict import deviations, figures
    from dsl_core.io.neighbours import beside_result, stem_of
    from dsl_core.io.result.result_file import load_result, read_attributes
    from dsl_core.workflows.truths import truth_of

    if report is None:
        read_attributes(path)
        report = beside_result(path, ".html")
    output = Output(json)
    check_targets([report], overwrite=force)
    result = load_result(path)
    truth = truth_of(result, truth_rig, parse_options(option))
    evaluation = pipeline.evaluate(result, truth)
    pipeline.write_report(report_content(stem_of(path), result, truth, evaluation), report, force)
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
    from dsl_core.io.objects.rooms import brought

    output = Output(json)
    with ExitStack() as stack:
        with output.progress() as progress:
            path = stack.enter_context(brought(path, progress))
        files = _export(output, path, form, target, parse_pixels(pixel), force)
    _say_written(output, files)


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
        is_scan = (path / MANIFEST_NAME).is_file()
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
