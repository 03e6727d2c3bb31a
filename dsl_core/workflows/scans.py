"""Scans on disk, which know where they come from: resumed, reconstructed and compared with their truth."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING

from dsl_core.capture.metering import WHITE_IN_DOUBT
from dsl_core.capture.movement import check_movement, pick_dark_shots, pick_reference_shots
from dsl_core.capture.proof.report import SeenFrames, WatchedSource, prove
from dsl_core.capture.runner import Status
from dsl_core.capture.sentinels import movement_of
from dsl_core.devices.base import DeviceRig
from dsl_core.devices.conditions import conditions_of
from dsl_core.devices.registry import is_built_in, open_rig
from dsl_core.errors import CalibrationError, DriftError, StoreError
from dsl_core.evaluation.cost import COSTS_ATTRIBUTE, StageTimer
from dsl_core.io.linearity import Linearity, linearity_of
from dsl_core.io.result.inventory import MADE_OF, check_inventory
from dsl_core.io.scan.as_exposed import as_exposed
from dsl_core.io.scan.check import require_complete
from dsl_core.io.scan.folder import ScanReader
from dsl_core.io.scan.manifest import Manifest, read_manifest, refuse_other_scan
from dsl_core.io.scan.origin import is_of_this_computer, model_notes, rig_of_notes
from dsl_core.io.scan.proof_file import read_proof
from dsl_core.model.attributes import (
    DOUBTS,
    PLAN_ATTRIBUTE,
    SCALE_ATTRIBUTE,
)
from dsl_core.model.conditions import differences
from dsl_core.model.fit import ATTRIBUTE as FIT_ATTRIBUTE
from dsl_core.model.fit import Fit
from dsl_core.model.frames import FrameSource
from dsl_core.model.plan import CapturePlan
from dsl_core.model.result_sink import ResultSink, SeenGeometry
from dsl_core.model.rig import Rig
from dsl_core.model.scan_proof import ScanProof
from dsl_core.patterns.images import pattern_image
from dsl_core.pipeline import Options, reconstruct, scan
from dsl_core.progress import NoProgress, Progress
from dsl_core.reconstruction.calibration_age import (
    aged,
    light_level,
    scale_in_words,
    unseen_since,
    whole_scale_rel_std,
)
from dsl_core.version import __version__
from dsl_core.workflows.captures import is_import, sensor_of_scan, with_imported_sensor

if TYPE_CHECKING:
    import xarray as xr

#: Attribute of a result: how many frames show too little to be judged by their pattern, as "26 of 150".
NOT_JUDGED = "frames_not_judged"


def reopen_rig(folder: Path) -> DeviceRig:
    """The rig that a scan was started with; raises `StoreError` when the scan does not say which.

    A scan from another computer opens the twin or a replay only: no devices because a file names them.
    """
    notes = read_manifest(folder).notes
    origin = rig_of_notes(notes)
    if origin is None:
        raise StoreError(
            f"{folder} does not say with which rig it was captured. Name it with --rig and --option."
        )
    if not is_built_in(origin[0]) and not is_of_this_computer(notes):
        raise StoreError(
            f"{folder} was captured on another computer with the rig {origin[0]!r}, which is not opened only"
            " because a file names it. If you mean that rig, name it with --rig and --option."
        )
    return open_rig(*origin)


def resume(
    rig: DeviceRig, folder: Path, progress: Progress | None = None, check_drift: bool = True
) -> Status:
    """Resume a scan after a check whether anything moved; raises `DriftError` if it did.

    Without that check, pictures are not judged either: they may well show another scene.
    """
    return scan(*prepare_resume(rig, folder, check_drift), folder, progress, prove=check_drift)


def prepare_resume(rig: DeviceRig, folder: Path, check_drift: bool = True) -> tuple[DeviceRig, CapturePlan]:
    """Rig and plan to resume a scan with.

    It has the same devices and the scan's own calibration, whatever ``rig`` has, which stays as it is. Raises
    `StoreError` for other devices or settings, `DriftError` if anything moved since the scan stopped.
    """
    reader = ScanReader(folder)
    # Pictures of another camera would be taken for another scene.
    now = {"camera": rig.camera.info, "projector": rig.projector.info}
    refuse_other_scan(folder, reader.manifest, reader.manifest.model_copy(update=now))
    rig = replace(rig, calibration=reader.calibration or rig.calibration)
    sound = reader.sound()  # a damaged frame is taken again, and tells nothing of the scene
    done = [shot for shot in reader.plan.shots() if shot.index in sound]
    if check_drift and 0 < len(done) < reader.plan.shot_count:
        sensor = None if reader.calibration is None else reader.calibration.sensor
        gone = (s.index for s in reader.plan.shots() if s.index not in sound)
        moved = movement_of(as_exposed(reader), sensor, gone, rig.camera.info.bit_depth)
        if moved is not None and moved.after is not None:
            # What was captured after a motion does not show how things should be.
            done = [shot for shot in done if shot.index <= moved.after]
        shots, dark = pick_reference_shots(done), pick_dark_shots(done)
        report = check_movement(rig, as_exposed(reader), shots, pattern_image, dark)
        if not report.is_stable:
            raise DriftError(report.message)
    return rig, reader.plan


def reconstruct_scan(
    folder: Path,
    calibration: Rig | None = None,
    options: Options | None = None,
    progress: Progress | None = None,
    timer: StageTimer | None = None,
    override_calibration: bool = False,
    sink: ResultSink | None = None,
    seen_geometry: SeenGeometry | None = None,
) -> xr.Dataset:
    """The result of a complete scan, with its origin and the cost of each stage among its attributes.

    It is in memory, unless a ``sink`` takes it; ``seen_geometry`` is given depth and points before the
    spectra. Raises `CalibrationError` when the scan was taken with other settings than the calibration given,
    unless that is overridden.
    """
    reader, timer = ScanReader(folder), timer or StageTimer()
    require_complete(reader)
    if calibration is not None and not override_calibration:
        _require_conditions(folder, reader.manifest, calibration)
    rig, options = with_imported_sensor(reader, calibration_of(reader, calibration)), options or Options()
    proof = read_proof(reader, rig)
    watched = WatchedSource(exposed := as_exposed(reader, rig.sensor))
    progress = progress or NoProgress()
    # An import is dated by when it was made, and nobody knows when its pictures were taken.
    stated = rig if is_import(reader) else aged(rig, reader.manifest.created)
    result = reconstruct(
        watched if proof is None else exposed, stated, options, progress, timer, sink, seen_geometry
    )
    if proof is None:
        with timer.stage("compare frames with their patterns"):
            progress.report("compare frames with their patterns", 0, 0)
            sensor = rig.sensor
            proof = prove(
                exposed, watched.seen, rig, sensor.bit_depth, sensor.bayer, knows_light=not is_import(reader)
            )
    doubts = _doubts(reader, proof)
    return result.assign_attrs(
        {
            **reader.manifest.notes,  # first, so that no note of a stranger's scan hides what was found
            **({DOUBTS: json.dumps(doubts)} if doubts else {}),
            **({NOT_JUDGED: proof.not_judged} if proof.untold else {}),
            **model_notes(rig, options.correspondence),
            **_dated(result, rig, reader, has_spectra=options.spectra),
            "captured": reader.manifest.created,
            "captured_with": reader.manifest.rig_name,
            PLAN_ATTRIBUTE: reader.plan.model_dump_json(),
            "capture_seconds": _capture_seconds(reader.manifest),
            COSTS_ATTRIBUTE: json.dumps([asdict(stage) for stage in timer.stages]),
        }
    )


def _doubts(reader: ScanReader, proof: ScanProof | None) -> list[str]:
    """What was found before a scan began, and of its pictures, as far as that is known."""
    before = reader.manifest.notes.get(WHITE_IN_DOUBT, "")
    found = () if proof is None else proof.doubts
    # The scan may have found the same once more, in other figures.
    is_said = any(each.startswith(before.split(":")[0]) for each in found)
    return [*([before] if before and not is_said else []), *found]


def known_doubts(folder: Path) -> list[str]:
    """What was found before a scan began and when it ended, in sentences; raises `StoreError`."""
    reader = ScanReader(folder)
    return _doubts(reader, None if reader.calibration is None else read_proof(reader, reader.calibration))


def _dated(
    result: xr.Dataset, rig: Rig, reader: ScanReader, *, has_spectra: bool = True
) -> dict[str, str | float]:
    """The verdict of a result, with what its scan cannot tell of an old calibration, or of its light."""
    fit = Fit.read({str(name): value for name, value in result.attrs.items()})
    if fit is None:
        return {}
    # Nobody knows when the pictures of an import were taken, so that no check is one of their light.
    captured = "" if is_import(reader) else reader.manifest.created
    level = light_level(rig, captured)
    fit = fit.model_copy(
        update={
            "unseen": " ".join(part for part in (fit.unseen, unseen_since(rig, captured)) if part),
            "level_rel_std": max(fit.level_rel_std, 0.0 if level is None else level.rel_std),
        }
    )
    if not has_spectra:
        return {FIT_ATTRIBUTE: fit.model_dump_json()}
    scale = whole_scale_rel_std(rig, captured, fit)
    said = {"scale_rel_std": scale, "scale": scale_in_words(rig, captured, scale)}
    return {FIT_ATTRIBUTE: fit.model_copy(update=said).model_dump_json(), SCALE_ATTRIBUTE: round(scale, 5)}


def reconstruct_to(
    target: Path,
    folder: Path,
    calibration: Rig | None = None,
    options: Options | None = None,
    progress: Progress | None = None,
    timer: StageTimer | None = None,
    *,
    override_calibration: bool = False,
    overwrite: bool = False,
    seen_geometry: SeenGeometry | None = None,
    seen_rows: Callable[[int, int], object] | None = None,
) -> Path:
    """Reconstruct a complete scan into a folder, by rows, so that neither has to fit into memory.

    One that was interrupted continues where it was if scan, calibration and options are the same.
    ``seen_geometry`` is given depth, points and normals before the spectra are computed, ``seen_rows`` how
    many rows are finished, and of how many. Raises what `reconstruct_scan` does, and `StoreError` when the
    target exists (unless ``overwrite``) or the disk fails.
    """
    from dsl_core.io.result.row_writer import RowWriter

    reader, options, timer = ScanReader(folder), options or Options(), timer or StageTimer()
    facts = _facts_of_result(reader, calibration, options)
    with RowWriter(target, facts, overwrite=overwrite, seen_rows=seen_rows) as writer:
        progress = progress or NoProgress()
        given = folder, calibration, options, progress, timer, override_calibration
        result = reconstruct_scan(*given, sink=writer, seen_geometry=seen_geometry)
        with timer.stage("save the result"):
            progress.report("save the result", 0, 0)
            return writer.publish({**result.attrs, MADE_OF: _digest(facts)})


def _facts_of_result(reader: ScanReader, calibration: Rig | None, options: Options) -> str:
    """All that a result depends on, as a text."""
    frames = {str(shot): entry.crc32 for shot, entry in sorted(reader.entries.items())}
    rig = calibration_of(reader, calibration)
    return json.dumps(
        [__version__, reader.manifest.model_dump_json(), frames, rig.model_dump_json(), repr(options)]
    )


def _digest(facts: str) -> str:
    return hashlib.sha256(facts.encode()).hexdigest()


def key_of_result(reader: ScanReader, calibration: Rig | None, options: Options) -> str:
    """What a result of a scan has as its attribute `MADE_OF`; raises `CalibrationError`.

    Frames, plan, calibration, options and the version of the program decide about it.
    """
    return _digest(_facts_of_result(reader, calibration, options))


def is_made_of(target: Path, key: str) -> bool:
    """Whether a result is there, complete, and of this key; raises `StoreError` where it is damaged."""
    from dsl_core.io.result.result_file import read_attributes

    if not (target / "zarr.json").is_file():
        return False
    attributes = read_attributes(target)
    return attributes.get(MADE_OF) == key and check_inventory(target, attributes)


def says_what_made_it(target: Path) -> bool:
    """Whether what is there states a key, as results saved from Python do not; raises `StoreError`."""
    from dsl_core.io.result.result_file import read_attributes

    return (target / "zarr.json").is_file() and MADE_OF in read_attributes(target)


def prove_scan(folder: Path) -> ScanProof:
    """What the pictures of a scan show but damaged ones, and what moved in it; raises `StoreError`."""
    reader = as_exposed(ScanReader(folder))
    seen = SeenFrames(reader.plan)
    seen.read_missing(reader)
    camera = reader.manifest.camera
    settings = (camera.bit_depth, camera.bayer) if camera else (12, "RGGB")
    # Nobody knows how long pictures of other programs were exposed.
    knows_light = not is_import(reader)
    return prove(reader, seen, reader.calibration, *settings, missing=seen.unseen, knows_light=knows_light)


def _absent(reader: ScanReader) -> set[int]:
    sound = set(reader.entries) & reader.store.stored()
    return {shot.index for shot in reader.plan.shots() if shot.index not in sound}


def linearity_of_scan(folder: Path) -> Linearity:
    """Whether the values of a scan are linear in light, by the sums of its patterns and inverses.

    Imported pictures are judged as their mapping read them; damaged ones are left out. Raises `StoreError`.
    """
    reader = ScanReader(folder)
    sensor = sensor_of_scan(reader)
    reader = as_exposed(reader, sensor)
    levels = sensor.full_scale_dn, sensor.black_level_dn
    try:
        return linearity_of(reader, *levels, _absent(reader))
    except StoreError:
        every = {shot.index for shot in reader.plan.shots()}
        return linearity_of(reader, *levels, every - reader.sound())


def calibration_of(source: FrameSource, given: Rig | None = None) -> Rig:
    """The calibration to use: the one given, else the one stored with the scan; raises `CalibrationError`."""
    rig = given or getattr(source, "calibration", None)
    if rig is None:
        raise CalibrationError(
            "The scan contains no calibration, and none was given. Name one with --calibration FILE."
        )
    return rig


def _capture_seconds(manifest: Manifest) -> float:
    """Exposures and, where the projector is known, its latencies; pauses and retries are not counted."""
    latency_ms = 0.0 if manifest.projector is None else manifest.projector.latency_ms
    return round(manifest.plan.duration_s(latency_ms), 3)


def _require_conditions(folder: Path, manifest: Manifest, rig: Rig) -> None:
    if rig.conditions is None or manifest.camera is None or manifest.projector is None:
        return
    found = differences(rig.conditions, conditions_of(manifest.camera, manifest.projector))
    if found:
        raise CalibrationError(
            f"The calibration {rig.name!r} is not for the scan {folder}: {'; '.join(found)} in the scan."
            " Name the calibration of its rig, or use this one anyway with --override-calibration."
        )
