"""Commands for capture: scenes, plan, scan, resume."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from dsl_core.cli.guidance import resumed_by
from dsl_core.cli.options import (
    CalibrationName,
    Code,
    Comb,
    Effects,
    Force,
    Json,
    Lines,
    Meter,
    OverrideCalibration,
    PlanChoice,
    PlanSource,
    RigName,
    RigOptions,
    Sentinel,
    Settings,
    Tolerance,
    parse_options,
    tab_rigs,
    with_effects,
)
from dsl_core.cli.output import Output
from dsl_core.errors import StoreError
from dsl_core.io import MANIFEST_NAME
from dsl_core.io.staging import check_targets
from dsl_core.words import counted, quoted

if TYPE_CHECKING:
    from dsl_core.capture.runner import Status
    from dsl_core.devices.base import DeviceRig
    from dsl_core.model.plan import CapturePlan


def scenes(json: Json = False) -> None:
    """List the scenes of the twin and their options."""
    from dsl_core.simulation.scenes.catalogue import scene_catalogue

    output, entries = Output(json), scene_catalogue()
    output.table(
        ("scene", "what it shows", "options with defaults"),
        [(e.name, e.description, ", ".join(f"{k}={v}" for k, v in e.options.items())) for e in entries],
    )
    output.put(scenes=[vars(entry) for entry in entries])
    output.finish()


def plan(
    target: Annotated[Path, typer.Argument(metavar="PLAN.json", help="File to write.")],
    rig: RigName = "twin",
    option: RigOptions = [],  # noqa: B006 - typer reads it, nobody changes it
    code: Code = None,
    lines: Lines = None,
    comb: Comb = None,
    setting: Settings = [],  # noqa: B006
    sentinels: Sentinel = None,
    force: Force = False,
    json: Json = False,
) -> None:
    """Write a plan of what to capture; show its frames, minutes and bytes."""
    from dsl_core.capture.preflight import require_possible
    from dsl_core.devices.registry import open_rig
    from dsl_core.io.plan_file import save_plan
    from dsl_core.pipeline import fit_plan

    check_targets([target], overwrite=force)
    output, choice = Output(json), PlanChoice(None, code, lines, comb, setting, sentinels).build()
    with open_rig(rig, parse_options(option)) as devices:
        made = fit_plan(choice, devices, keeps_patterns=comb is not None)
        _require_patterns(made)
        require_possible(devices, made)
        _state(output, made, target.parent, devices)
    save_plan(made, target, overwrite=force)
    output.say(
        f"The plan is saved in {target}."
        f" Next: dsl-scan scan SCAN.dsl --plan {quoted(target)} and the same rig."
    )
    output.put(plan=target)
    output.finish()


def scan(
    target: Annotated[Path, typer.Argument(metavar="SCAN.dsl", help="New folder for the frames.")],
    rig: RigName = "twin",
    option: RigOptions = [],  # noqa: B006
    plan: PlanSource = None,
    code: Code = None,
    lines: Lines = None,
    comb: Comb = None,
    setting: Settings = [],  # noqa: B006
    sentinels: Sentinel = None,
    calibration: CalibrationName = None,
    override: OverrideCalibration = False,
    effects: Effects = None,
    tolerance: Tolerance = None,
    meter: Meter = None,
    json: Json = False,
) -> None:
    """Capture a plan; every frame is saved to disk before the next is captured."""
    from dsl_core import pipeline
    from dsl_core.devices.registry import open_rig
    from dsl_core.io.scan.folder import require_name
    from dsl_core.io.scan.origin import rig_notes

    require_name(target)
    output, options = Output(json), with_effects(parse_options(option), effects, tolerance)
    choice = PlanChoice(plan, code, lines, comb, setting, sentinels)
    made = choice.build()
    if (target / MANIFEST_NAME).exists():
        raise StoreError(
            f"{target} already contains a scan."
            f" Choose a new name, or resume it with: dsl-scan resume {quoted(target)}"
        )
    with open_rig(rig, options) as devices:
        calibrated, overridden = _calibrate(output, devices, calibration, override)
        fitted = (
            made
            if choice.is_written
            else pipeline.fit_plan(made, calibrated, keeps_patterns=comb is not None)
        )
        _require_patterns(fitted)
        notes = rig_notes(rig, options) | overridden
        if meter if meter is not None else not choice.is_exposed:
            fitted, metered = _metered(output, calibrated, fitted)
            notes |= metered
        _state(output, fitted, target, calibrated)
        with output.progress() as progress, resumed_by(f"dsl-scan resume {quoted(target)}"):
            status = pipeline.scan(calibrated, fitted, target, progress, notes)
    _done(output, target, status)


def resume(
    target: Annotated[Path, typer.Argument(metavar="SCAN.dsl", help="Folder of the scan.")],
    rig: Annotated[
        str | None,
        typer.Option(
            "--rig", help="Rig to use instead of the one recorded in the scan.", autocompletion=tab_rigs
        ),
    ] = None,
    option: RigOptions = [],  # noqa: B006
    drift: Annotated[
        bool,
        typer.Option(
            "--drift-check/--no-drift-check",
            help="Compare two old frames before resuming, and check that each picture shows its pattern.",
        ),
    ] = True,
    json: Json = False,
) -> None:
    """Resume a scan that was stopped or killed, at its next missing frame."""
    from dsl_core.devices.registry import open_rig
    from dsl_core.workflows import scans

    output = Output(json)
    _say_gaps(output, target)
    opened = open_rig(rig, parse_options(option)) if rig else scans.reopen_rig(target)
    with opened as devices, output.progress() as progress, resumed_by(f"dsl-scan resume {quoted(target)}"):
        status = scans.resume(devices, target, progress, drift)
    _done(output, target, status)


def _say_gaps(output: Output, target: Path) -> None:
    """Say how many frames a scan lacks, and how many of those it has cannot be used."""
    from dsl_core.io.scan.folder import ScanReader

    reader = ScanReader(target)
    missing = len(reader.missing())
    damaged = reader.plan.shot_count - len(reader.sound()) - missing
    if missing:
        more = f"; damaged, and captured again: {damaged}" if damaged else ""
        output.say(f"{target} lacks {counted(missing, 'frame')}{more}.")
    elif damaged:
        output.say(f"{target} has {counted(damaged, 'damaged frame')}, captured again now.")
    else:
        output.say(f"{target} has all frames.")
    output.put(missing=missing, damaged=damaged)


def _calibrate(
    output: Output, devices: DeviceRig, name: str | None, override: bool
) -> tuple[DeviceRig, dict[str, str]]:
    """The rig with the calibration named, if any; what was overridden, as notes of the scan."""
    from dsl_core.devices.conditions import with_calibration
    from dsl_core.io.calibration_library import load_calibration
    from dsl_core.model.calibration.accepted import missed_limits

    if name is None:
        return devices, {}
    rig = load_calibration(name)
    calibrated, overridden = with_calibration(devices, rig, override)
    missed = missed_limits(rig.calibrations)
    for sentence in missed:
        output.say(sentence)
    if missed:
        output.put(calibration_missed=missed)
    for clause in overridden:
        output.say(f"Overridden: {clause}.")
    return calibrated, {"calibration_overridden": "; ".join(overridden)} if overridden else {}


def _require_patterns(plan: CapturePlan) -> None:
    """Raise `PlanError` when the plan's patterns cannot be made, before anything is written."""
    from dsl_core.patterns.images import pattern_image, spectral_profiles

    spectral_profiles(plan)
    pattern_image(plan, next(plan.shots()))


def _metered(output: Output, devices: DeviceRig, plan: CapturePlan) -> tuple[CapturePlan, dict[str, str]]:
    """The plan with exposures for the scene, and what was measured, as notes of the scan."""
    from dsl_core import pipeline

    found = pipeline.meter(devices, plan)
    if found.is_told:
        output.say(found.sentence)
    if found.sentence:
        output.put(metered=found.sentence)
    return found.plan, found.notes


def _state(output: Output, plan: CapturePlan, folder: Path, devices: DeviceRig) -> None:
    """Say what a plan will take, and what its scan will suffer from."""
    from dsl_core.capture.preflight import find_remarks
    from dsl_core.io.scan.estimate import estimate

    needs = estimate(plan, folder, devices.projector.info.latency_ms)
    output.say(f"{devices.name}: {needs}.")
    output.put(frames=needs.frames, minutes=round(needs.seconds / 60, 3))
    output.put(needed_bytes=needs.needed_bytes, free_bytes=needs.free_bytes)
    remarks = find_remarks(devices.calibration)
    for each in remarks:
        output.say(each)
    if remarks:
        output.put(remarks=remarks)


def _done(output: Output, target: Path, status: Status) -> None:
    from dsl_core.workflows.scans import known_doubts

    captured = status.done - status.earlier
    which = f"{captured} of them in " if status.earlier else ""
    time = f"{which}{status.elapsed_s:.1f} s"
    output.say(f"All {status.total} frames are saved in {target} ({time}). {next_step(target)}")
    if status.overexposed:  # said on standard error when it was seen
        output.put(overexposed=status.overexposed)
    if status.warning:
        output.say(status.warning)
        output.put(warning=status.warning)
    doubts = [each for each in known_doubts(target) if each != status.warning]
    for each in doubts:
        output.say(each)
    if doubts:
        output.put(doubts=doubts)
    output.put(scan=target, frames=status.total, state="finished")
    output.put(captured=captured, seconds=round(status.elapsed_s, 2))
    output.finish()


def next_step(target: Path) -> str:
    """What follows a scan: without a calibration of its own it needs one, which may have to be made first."""
    from dsl_core.devices.replay import NAME
    from dsl_core.io.calibration_library import CalibrationLibrary
    from dsl_core.io.scan.folder import ScanReader
    from dsl_core.io.scan.origin import rig_of_notes

    reader, command = ScanReader(target), f"dsl-scan reconstruct {quoted(target)}"
    if reader.calibration is not None:
        return f"Next: {command}"
    known = CalibrationLibrary().names()
    if known:
        return (
            f"The scan has no calibration. Next: {command} --calibration NAME, where NAME is that of its rig"
            f" in the library, which has: {', '.join(known)}."
        )
    if reader.manifest.rig_name == NAME:
        return (
            "The scan has no calibration, and the library is empty. Next: calibrate the rig that captured the"
            f" scan played back, which 'replay' cannot be, then {command} --calibration CAMPAIGN"
        )
    rig, options = rig_of_notes(reader.manifest.notes) or ("RIG", {})
    given = [quoted(f"{key}={value}") for key, value in options.items()]
    words = " ".join([f"--rig {quoted(rig)}", *(f"--option {each}" for each in given)])
    return (
        "The scan has no calibration, and the library is empty. Next: calibrate the rig with"
        f" 'dsl-scan calibrate all CAMPAIGN {words}', then {command} --calibration CAMPAIGN"
    )
