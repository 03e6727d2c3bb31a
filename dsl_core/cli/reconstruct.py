"""Commands that turn scans into results: one, and many at once."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from dsl_core.cli.options import (
    CalibrationName,
    Force,
    Json,
    OverrideCalibration,
    Report,
    parse_bands,
)
from dsl_core.cli.output import Output
from dsl_core.cli.results import coverage, print_fit
from dsl_core.errors import PlanError
from dsl_core.evaluation.cost import StageTimer
from dsl_core.io.staging import check_targets, write_text
from dsl_core.solve.torch_device import DEVICES, torch_device

if TYPE_CHECKING:
    from dsl_core.model.options import Options as ReconstructionOptions
    from dsl_core.model.rig import Rig
    from dsl_core.workflows.batch.runner import Runner

#: Share of the free memory that jobs may take together.
MEMORY_SHARE = 0.9
#: Exit code where a scan failed: what was wrong with it is in the report.
_FAILED = 2

Bands = Annotated[str, typer.Option(help="START:STOP:STEP in nm.")]
Model = Annotated[str, typer.Option(help="Correspondence: auto, grating, hybrid or grid.")]
Solver = Annotated[str, typer.Option(help="best, published, nearest-line or colour-basis.")]
Refine = Annotated[bool, typer.Option("--refine/--no-refine", help="Find columns to a fraction of a pixel.")]
DepthOnly = Annotated[bool, typer.Option("--depth-only", help="Leave out the spectra.")]
AsCalibrated = Annotated[
    bool, typer.Option("--as-calibrated", help="Correct nothing by what the scan itself shows.")
]
Device = Annotated[str, typer.Option(help="cpu, cuda, or auto: cuda if available.")]


def reconstruction_options(
    bands: str,
    model: str,
    solver: str,
    refine: bool,
    depth_only: bool,
    as_calibrated: bool,
    device: str,
) -> ReconstructionOptions:
    """What the options of a command ask for; raises `PlanError` for what there is not."""
    from dsl_core.model.options import MODELS, SOLVERS, Options, names

    _require_one_of("--model", model, names(MODELS))
    _require_one_of("--solver", solver, names(SOLVERS))
    _require_one_of("--device", device, DEVICES)
    return Options(
        parse_bands(bands),
        model,
        refine,
        not depth_only,
        torch_device(device),
        solver=solver,
        as_calibrated=as_calibrated,
    )


def reconstruct(
    scan: Annotated[Path, typer.Argument(metavar="SCAN.dsl", help="A complete scan.")],
    target: Annotated[
        Path | None, typer.Option("--output", "-o", help="Folder to write; the default is SCAN.zarr.")
    ] = None,
    calibration: CalibrationName = None,
    override: OverrideCalibration = False,
    bands: Bands = "430:660:5",
    model: Model = "auto",
    solver: Solver = "best",
    refine: Refine = True,
    depth_only: DepthOnly = False,
    as_calibrated: AsCalibrated = False,
    device: Device = "cpu",
    force: Force = False,
    json: Json = False,
) -> None:
    """Turn frames into depth, points, normals, reflectance and their uncertainty."""
    from dsl_core.io.calibration_library import load_calibration
    from dsl_core.io.neighbours import result_beside
    from dsl_core.io.objects.address import shown
    from dsl_core.io.objects.rooms import bring_frames, brought, published
    from dsl_core.io.result.result_file import RESULT_FOLDER
    from dsl_core.io.scan.manifest import read_manifest

    output = Output(json)
    options = reconstruction_options(bands, model, solver, refine, depth_only, as_calibrated, device)
    place = target or result_beside(scan)
    with ExitStack() as stack:
        with output.progress() as progress:
            folder = stack.enter_context(brought(scan, progress, frames=False))
            draft = stack.enter_context(published(place, overwrite=force, progress=progress))
            if target is None and draft.exists():
                read_manifest(folder)  # that it is no scan is told before that its result exists
            # What is here of a result in a store is our own, from a run that was stopped.
            force = force or draft != place
            check_targets([draft], overwrite=force, kind=RESULT_FOLDER)
            bring_frames(scan, folder, progress)
        rig = load_calibration(calibration) if calibration else None
        if rig is None and _tells_columns_only(folder):
            found = _decode(output, folder, draft, force)
        else:
            if _is_import(folder):
                # Pictures of other programs have no frames of spectral patterns.
                options = replace(options, spectra=False)
            found = _reconstruct(output, folder, draft, rig, options, override, force)
    output.say(f"{found} The result is saved in {shown(place)}")
    output.put(result=place)
    output.finish()


def _reconstruct(
    output: Output,
    scan: Path,
    target: Path,
    rig: Rig | None,
    options: ReconstructionOptions,
    override: bool,
    force: bool,
) -> str:
    """Depth and spectra; what was found, in a sentence."""
    from dsl_core.io.result.result_file import load_result
    from dsl_core.model.attributes import DOUBTS, sentences_of
    from dsl_core.workflows.batch.task import doubts_of
    from dsl_core.workflows.scans import NOT_JUDGED, reconstruct_to

    timer = StageTimer()
    with output.progress() as progress:
        reconstruct_to(
            target, scan, rig, options, progress, timer, override_calibration=override, overwrite=force
        )
    result = load_result(target)
    output.costs(timer.stages)
    doubts = list(sentences_of(result.attrs, DOUBTS))
    for sentence in doubts_of(result):
        output.say(sentence)
    not_judged = result.attrs.get(NOT_JUDGED, "")
    if not_judged:
        output.say(f"{not_judged} pictures show too little to be compared with their pattern.")
    share = coverage(result)
    print_fit(output, result)
    output.put(pixels_with_depth=share, wrong_pictures=doubts, pictures_not_judged=not_judged)
    return f"{share:.1%} of the pixels have a depth."


def _is_import(scan: Path) -> bool:
    from dsl_core.io.scan.folder import ScanReader
    from dsl_core.workflows.captures import is_import

    return is_import(ScanReader(scan))


def _tells_columns_only(scan: Path) -> bool:
    """Whether a scan was made of another program's pictures, and nobody said where its devices stand."""
    from dsl_core.io.scan.folder import ScanReader

    return _is_import(scan) and ScanReader(scan).calibration is None


def _decode(output: Output, scan: Path, target: Path, force: bool) -> str:
    """Columns alone; what was found, in a sentence."""
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
    output.put(pixels_with_depth=0.0, pixels_with_column=share, no_depth=result.attrs[NO_DEPTH])
    return f"{100 * told:.1f} % of the pixels have a {what}."


def _require_one_of(option: str, given: str, choices: tuple[str, ...]) -> None:
    if given not in choices:
        raise PlanError(f"{option} must be one of {', '.join(choices)}, not {given!r}.")


def batch(
    source: Annotated[
        Path, typer.Argument(metavar="FOLDER", help="A folder with scans, or a text file with a path a line.")
    ],
    results: Annotated[
        Path | None,
        typer.Option("--results", help="Folder for results; the default is next to each scan."),
    ] = None,
    jobs: Annotated[
        int | None, typer.Option("--jobs", "-j", min=1, help="Scans at once here; the default is 1.")
    ] = None,
    scheduler: Annotated[
        str | None,
        typer.Option("--scheduler", help="Use the workers of a Dask scheduler, like tcp://10.0.0.5:8786."),
    ] = None,
    calibration: CalibrationName = None,
    override: OverrideCalibration = False,
    bands: Bands = "430:660:5",
    model: Model = "auto",
    solver: Solver = "best",
    refine: Refine = True,
    depth_only: DepthOnly = False,
    as_calibrated: AsCalibrated = False,
    device: Device = "cpu",
    report: Report = None,
    force: Force = False,
    json: Json = False,
) -> None:
    """Reconstruct many scans; those that are complete are skipped, and one that fails stops no other.

    Give the same command again to continue after Ctrl-C, a kill or a power cut.
    """
    from dsl_core.io.calibration_library import load_calibration
    from dsl_core.workflows.batch.batch import find_scans, run_batch, tasks_of
    from dsl_core.workflows.batch.report import batch_page, batch_sentences, batch_table, is_batch_page

    output = Output(json)
    if jobs is not None and scheduler is not None:
        raise PlanError("--jobs is for this computer, --scheduler has workers of its own. Give one of them.")
    options = reconstruction_options(bands, model, solver, refine, depth_only, as_calibrated, device)
    # The same command continues a batch, and so replaces the report on it, but no other file.
    again = force or (report is not None and is_batch_page(report))
    check_targets([] if report is None else [report], overwrite=again)
    rig = load_calibration(calibration) if calibration else None
    tasks = tasks_of(
        find_scans(source), results, rig, options, override_calibration=override, overwrite=force
    )
    runner = _runner(jobs or 1, scheduler)
    with output.progress() as progress:
        found = run_batch(tasks, runner, progress)
    table = batch_table(found)
    output.table(table.heads, table.rows)
    for sentence in batch_sentences(found):
        output.say(sentence)
    output.say(found.words)
    output.put(scans=[asdict(each) for each in found.outcomes])
    if report is not None:
        output.put(report=write_text(report, lambda: batch_page(found), overwrite=again))
        output.say(f"The report is saved in {report}")
    output.finish()
    if found.of("failed"):
        raise typer.Exit(_FAILED)


def _runner(jobs: int, scheduler: str | None) -> Runner:
    if scheduler is not None:
        from dsl_core.extras import require_package
        from dsl_core.workflows.batch.cluster import Cluster

        require_package("distributed")
        return Cluster(scheduler)
    from dsl_core.solve.limits import free_memory_bytes
    from dsl_core.workflows.batch.batch import needed_bytes
    from dsl_core.workflows.batch.processes import Processes

    return Processes(jobs, MEMORY_SHARE * free_memory_bytes(), needed_bytes)
