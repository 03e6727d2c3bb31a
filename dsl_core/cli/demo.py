"""The demo: a scan of a Color Checker on the twin, from the first pattern to the report."""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from dsl_core.cli.guidance import resumed_by
from dsl_core.cli.options import Effects, Json, Tolerance, parse_size, with_effects
from dsl_core.cli.output import Output
from dsl_core.cli.results import print_figures
from dsl_core.evaluation.cost import StageTimer
from dsl_core.io import MANIFEST_NAME
from dsl_core.words import quoted

if TYPE_CHECKING:
    import xarray as xr

    from dsl_core.model.plan import CapturePlan

SCAN, RESULT, REPORT = "scan.dsl", "result.zarr", "report.html"
#: Shin et al., CVPR 2024: mean over the Color Checker on the real rig.
PUBLISHED = {"spectral_rmse": 0.038, "spectral_angle_rad": 0.138}


def demo(
    out: Annotated[
        Path,
        typer.Option("--output", "-o", "--out", help="Folder to write; a number is added if it exists."),
    ] = Path("dsl-demo"),
    size: Annotated[str, typer.Option(help="Camera pixels; the published rig has 890x580.")] = "445x290",
    scene: Annotated[
        str, typer.Option(help="A scene of the twin; 'dsl-scan scenes' lists them.")
    ] = "color-checker",
    effects: Effects = None,
    tolerance: Tolerance = None,
    open_: Annotated[bool, typer.Option("--open/--no-open", help="Open the report in a browser.")] = False,
    json: Json = False,
) -> None:
    """Scan, reconstruct and evaluate a Color Checker on the digital twin, and write a report."""
    output, timer = Output(json), StageTimer()
    width, height = parse_size("--size", size)
    options = with_effects({"scene": scene, "size": f"{width}x{height}"}, effects, tolerance)
    folder = _choose_folder(out, options)
    with resumed_by(f"dsl-scan demo -o {quoted(out)}"):
        _capture(output, timer, folder, options)
        result = _reconstruct(output, timer, folder)
    figures = _evaluate(output, timer, folder, result)
    output.costs(timer.stages)
    for name, line in _lines(folder).items():
        output.say(f"{name:14s} {line}")
    output.put(folder=folder, report=folder / REPORT, figures=figures, published=PUBLISHED)
    output.finish()
    if open_:
        typer.launch((folder / REPORT).absolute().as_uri())


def _choose_folder(given: Path, options: dict[str, str]) -> Path:
    """The first of the name and its numbered variants that is free, or has this demo unfinished."""
    from dsl_core.io.scan.manifest import read_manifest
    from dsl_core.io.scan.origin import rig_notes

    for number in itertools.count(1):
        folder = given if number == 1 else given.with_name(f"{given.name}-{number}")
        if not folder.exists():
            return folder
        started = (folder / SCAN / MANIFEST_NAME).is_file() and not (folder / RESULT).exists()
        wanted_notes = rig_notes("twin", options).items()
        if started and wanted_notes <= read_manifest(folder / SCAN).notes.items():
            return folder
    raise AssertionError("numbers do not end")


def _plan() -> CapturePlan:
    """The published line frames; of the binary code the columns, since rows do not enter the result."""
    from dsl_core.model.plan import CapturePlan, GrayCode, Sentinels

    return CapturePlan(name="demo", code=GrayCode(rows=False), sentinels=Sentinels())


def _capture(output: Output, timer: StageTimer, folder: Path, options: dict[str, str]) -> None:
    from dsl_core import pipeline
    from dsl_core.devices.registry import open_rig
    from dsl_core.io.scan.origin import rig_notes

    with output.progress() as progress, timer.stage("scan on the twin"), open_rig("twin", options) as rig:
        plan = pipeline.fit_plan(_plan(), rig)
        output.say(
            f"Scanning {options['scene']} on the twin, {options['size']} px, {plan.shot_count} frames."
        )
        pipeline.scan(rig, plan, folder / SCAN, progress, rig_notes("twin", options))


def _reconstruct(output: Output, timer: StageTimer, folder: Path) -> xr.Dataset:
    from dsl_core.io.result.result_file import save_result
    from dsl_core.workflows.scans import reconstruct_scan

    with output.progress() as progress:
        result = reconstruct_scan(folder / SCAN, progress=progress, timer=timer)
    with timer.stage("save the result"):
        save_result(result, folder / RESULT)
    return result


def _evaluate(output: Output, timer: StageTimer, folder: Path, result: xr.Dataset) -> dict[str, float]:
    """Figures, exports and the report."""
    from dsl_core import pipeline
    from dsl_core.evaluation.report.scan_report import report_content
    from dsl_core.evaluation.verdict import Goal, figures
    from dsl_core.io.export import export
    from dsl_core.workflows.truths import truth_of

    with timer.stage("evaluate"):
        truth = truth_of(result)
        evaluation = pipeline.evaluate(result, truth)
    with timer.stage("export PLY, PNG, ENVI"):
        for form, name in (("ply", "points.ply"), ("png", "picture.png"), ("envi", "cube.hdr")):
            export(result, folder / name, form)
    found = figures(evaluation)
    goals = {name: Goal(limit) for name, limit in PUBLISHED.items() if name in found}
    with timer.stage("report"):
        content = report_content(
            "Demo on the digital twin", result, truth, evaluation, _summary(found), goals
        )
        pipeline.write_report(content, folder / REPORT)
    print_figures(output, evaluation)
    output.say(_summary(found))
    return found


def _summary(found: dict[str, float]) -> str:
    if "spectral_rmse" not in found:
        return "The scene has no patches with a known spectrum."
    return (
        f"Mean spectral RMSE {found['spectral_rmse']:.4f} and angle"
        f" {found['spectral_angle_rad']:.4f} rad on the twin;"
        f" published, on the real rig: {PUBLISHED['spectral_rmse']}"
        f" and {PUBLISHED['spectral_angle_rad']} rad."
    )


def _lines(folder: Path) -> dict[str, str]:
    return {
        "frames": f"{folder / SCAN}",
        "result": f"{folder / RESULT}",
        "points": f"{folder / 'points.ply'}",
        "pictures": f"{folder / 'picture_*.png'}",
        "spectral cube": f"{folder / 'cube.hdr'}",
        "report": f"{folder / REPORT}",
    }
