"""Commands for the library of calibrated rigs: ``calibrations list|show|check|restore|export|import``."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from dsl_core.cli.guidance import answer, figures_json, print_figures
from dsl_core.cli.options import (
    Force,
    Json,
    OverrideCalibration,
    RigName,
    RigOptions,
    html_page,
    parse_options,
    tab_calibrations,
)
from dsl_core.cli.output import Output
from dsl_core.errors import CalibrationError
from dsl_core.io.staging import check_targets

if TYPE_CHECKING:
    from dsl_core.io.calibration_library import LibraryLine
    from dsl_core.model.rig import Rig

calibrations = typer.Typer(help="The calibrated rigs on this computer.", no_args_is_help=True)

Name = Annotated[
    str,
    typer.Argument(
        metavar="NAME", help="A calibration's name, or NAME@DATE.", autocompletion=tab_calibrations
    ),
]


@calibrations.command("list")
def list_(json: Json = False) -> None:
    """List every version of every calibration, and why a damaged one cannot be read."""
    from dsl_core.io.calibration_library import CalibrationLibrary

    output, library = Output(json), CalibrationLibrary()
    lines = library.lines()
    if not lines:
        output.say(f"The library in {library.home} is empty. 'dsl-scan calibrate all' fills it.")
    else:
        headings = ("name", "version", "", "camera", "projector", "outside limits")
        output.table(headings, [_row(line) for line in lines])
    output.put(library=library.home, calibrations=[_facts(line) for line in lines])
    output.finish()


@calibrations.command()
def show(
    name: Name,
    report: Annotated[
        Path | None,
        typer.Option("--report", "-o", callback=html_page, help="Also write this HTML page."),
    ] = None,
    force: Force = False,
    json: Json = False,
) -> None:
    """Show what a calibration contains: conditions, dates, figures with uncertainties."""
    from dsl_core.campaign.products import write_calibration_report
    from dsl_core.io.calibration_library import CalibrationLibrary

    output, entry = Output(json), CalibrationLibrary().find(name)
    if report is not None:
        check_targets([report], overwrite=force)
        write_calibration_report(report, entry.rig, entry.accepted, entry.history)
    output.say(f"{entry.name}, version {entry.stamp}, rig {entry.rig.name}")
    _say_conditions(output, entry.rig)
    for note in entry.rig.calibrations:
        output.say(f"{note.title}, accepted {note.accepted[:16]}")
        print_figures(output, note.figures)
    if report is not None:
        output.say(f"The report is saved in {report}")
    output.put(name=entry.name, version=entry.stamp, report=report, rig=entry.rig.model_dump(mode="json"))
    output.finish()


@calibrations.command()
def check(
    name: Annotated[
        str,
        typer.Argument(
            metavar="NAME", help="A name in the library, or a rig's file.", autocompletion=tab_calibrations
        ),
    ],
    rig: RigName = "twin",
    option: RigOptions = [],  # noqa: B006 - typer reads it, nobody changes it
    spectralon: Annotated[
        bool, typer.Option("--spectralon/--any-target", help="The flat target is the Spectralon.")
    ] = True,
    keep: Annotated[Path | None, typer.Option(help="Folder to save the frames in.")] = None,
    override: OverrideCalibration = False,
    yes: Annotated[bool, typer.Option("--yes", help="Do not ask: the target is in place.")] = False,
    json: Json = False,
) -> None:
    """Check with one quick capture of a flat target whether the rig still matches its calibration."""
    from dsl_core.campaign.drift_check import PLACEMENT, measure_drift
    from dsl_core.campaign.light_history import keep_check
    from dsl_core.devices.conditions import with_calibration
    from dsl_core.devices.registry import open_rig
    from dsl_core.io.calibration_library import CalibrationLibrary, load_calibration
    from dsl_core.io.campaign_folder import now
    from dsl_core.model.figure import failures

    output, known, library = Output(json), load_calibration(name), CalibrationLibrary()
    with open_rig(rig, parse_options(option)) as devices, tempfile.TemporaryDirectory() as spare:
        own, overridden = with_calibration(devices, known, override)
        for clause in overridden:
            output.say(f"Overridden: {clause}.")
        if devices.place is not None:
            devices.place(PLACEMENT)
        elif not yes:
            target = "the Spectralon" if spectralon else "a flat, matt target"
            answer(output, f"Place {target}, film on. Then press Enter: ")
        with output.progress() as progress:
            figures = measure_drift(own, known, keep or Path(spare) / "check.dsl", spectralon, progress)
    print_figures(output, figures)
    is_listed = name.partition("@")[0] in library.names() and not Path(name).is_file()
    kept = is_listed and not overridden and keep_check(library, name, figures, now())
    if kept:
        output.say(f"{name} now remembers this check: scans from now on state the light by it.")
    if spectralon and not is_listed:
        output.say(f"{name} is a file and does not remember this check; a calibration of the library does.")
    output.put(name=name, figures=figures_json(figures), stable=not failures(figures), kept=kept)
    wrong = failures(figures)
    if wrong:
        clauses = "; ".join(f"{figure}. {figure.advice}".rstrip(". ") for figure in wrong)
        raise CalibrationError(f"The rig no longer matches {name}: {clauses}.")
    output.say(f"The rig matches {name}.")
    output.finish()


@calibrations.command()
def restore(
    name: Annotated[str, typer.Argument(metavar="NAME", autocompletion=tab_calibrations)],
    version: Annotated[str, typer.Argument(metavar="DATE", help="A version, or its first characters.")],
    json: Json = False,
) -> None:
    """Make an older version the current one; the previous one stays in the library."""
    from dsl_core.io.calibration_library import CalibrationLibrary

    output, entry = Output(json), CalibrationLibrary().restore(name, version)
    output.say(f"The current version of {name} is now {entry.stamp}.")
    output.put(name=name, version=entry.stamp)
    output.finish()


@calibrations.command()
def export(
    name: Name,
    target: Annotated[Path, typer.Argument(metavar="TARGET", help="File or folder to write.")],
    form: Annotated[
        str, typer.Option(help="entry (everything), rig (its file), or published (XML and .npy).")
    ] = "entry",
    force: Force = False,
    json: Json = False,
) -> None:
    """Export a calibration for another computer or program."""
    from dsl_core.campaign.products import export_entry
    from dsl_core.io.calibration_library import CalibrationLibrary

    output, entry = Output(json), CalibrationLibrary().find(name)
    files = export_entry(entry, target, form, force)
    output.say(f"Written: {', '.join(map(str, files))}")
    output.put(files=[str(file) for file in files])
    output.finish()


@calibrations.command("import")
def import_(
    source: Annotated[
        Path, typer.Argument(metavar="FILE", help="A file written by 'export', or a rig's JSON file.")
    ],
    name: Annotated[str | None, typer.Option(help="Name in the library; the default is its own.")] = None,
    json: Json = False,
) -> None:
    """Import a calibration into the library as the current version of its name."""
    from dsl_core.campaign.products import import_entry
    from dsl_core.io.calibration_library import CalibrationLibrary

    output, entry = Output(json), import_entry(source, CalibrationLibrary(), name or "")
    output.say(f"{entry.name} is in the library, version {entry.stamp}.")
    output.put(name=entry.name, version=entry.stamp)
    output.finish()


def _row(line: LibraryLine) -> tuple[str, ...]:
    current = "current" if line.is_current else ""
    if line.entry is None:
        return line.name, line.stamp, current, f"damaged: {line.error}", "", ""
    rig = line.entry.rig
    missed = [f"{figure}" for note in rig.calibrations for figure in note.failed]
    camera = f"{rig.provenance.camera_serial or '-'} {rig.camera.width_px}x{rig.camera.height_px}"
    return line.name, line.stamp, current, camera, rig.provenance.projector_serial or "-", ", ".join(missed)


def _facts(line: LibraryLine) -> dict[str, object]:
    facts: dict[str, object] = {"name": line.name, "version": line.stamp, "current": line.is_current}
    if line.entry is None:
        return {**facts, "error": line.error}
    rig = line.entry.rig
    conditions = rig.conditions.model_dump(mode="json") if rig.conditions else None
    notes = {note.name: figures_json(note.figures) for note in rig.calibrations}
    return {**facts, "conditions": conditions, "figures": notes}


def _say_conditions(output: Output, rig: Rig) -> None:
    if rig.conditions is None:
        output.say("The settings under which it was captured are not known.")
        return
    for name, part in (("camera", rig.conditions.camera), ("projector", rig.conditions.projector)):
        values = ", ".join(
            f"{key} {value}" for key, value in part.model_dump().items() if value not in (None, "")
        )
        output.say(f"{name}: {values}")
