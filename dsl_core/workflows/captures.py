"""Captures of other programs: pictures become a scan by a mapping, and a scan without calibration columns."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from dsl_core.devices.base import DeviceRig
from dsl_core.devices.replay import ReplayCamera, ReplayProjector
from dsl_core.errors import CalibrationError, StoreError
from dsl_core.io import MANIFEST_NAME
from dsl_core.io.pictures.mapped_doubts import require_pairs
from dsl_core.io.pictures.mapping import Mapping, PhasePictures, untold_direction
from dsl_core.io.pictures.source import PictureScan, open_pictures
from dsl_core.io.records import read_record
from dsl_core.io.scan.check import require_complete
from dsl_core.io.scan.folder import ScanReader, ScanWriter
from dsl_core.io.scan.frame_store import checksum
from dsl_core.io.scan.manifest import read_manifest
from dsl_core.model.base import problems_in_words
from dsl_core.model.captured_code import CapturedCode, Stripes
from dsl_core.model.frames import Frame, FrameSource
from dsl_core.model.plan import CapturePlan, GrayCode, Shot, XorCode
from dsl_core.model.result import Flag, build_result
from dsl_core.model.rig import ProjectorResponse, Rig, Sensor
from dsl_core.progress import NoProgress, Progress
from dsl_core.words import readable

if TYPE_CHECKING:
    import xarray as xr

#: Notes of a scan: from which pictures it was made, how they were mapped, what their numbers are.
FINGERPRINT, MAPPING, SENSOR = "imported_fingerprint", "imported_mapping", "imported_sensor"
#: Attribute of a result: why it has columns and no depth.
NO_DEPTH = "no_depth"
#: Electrons of a full pixel of common cameras; that of a stranger's camera is not known.
FULL_WELL = 10_000.0
#: Pixels are lit where white stands this many deviations above black.
LIT_SIGMAS = 8.0


def load_mapping(path: Path) -> Mapping:
    """A mapping from its JSON file, unsure of directions that it does not state.

    Raises `StoreError` that names the field that is wrong.
    """
    mapping = read_record(
        path,
        Mapping,
        "Correct it, or let 'dsl-scan import FOLDER --guess' write one.",
        called="The mapping",
        fault="is not a mapping",
    )
    untold = [
        untold_direction(part.axis, f"direction {part.direction} (frame k of N with the phase + 2πk/N)")
        for part in mapping.parts
        if isinstance(part, PhasePictures) and "direction" not in part.model_fields_set
    ]
    return mapping.model_copy(update={"unsure": (*mapping.unsure, *untold)})


def sensor_of(scan: PictureScan) -> Sensor:
    """What is assumed of a camera that nobody described: the noise of a common one, no black level."""
    common = common_sensor(scan.bit_depth)
    found = {"bayer": scan.mapping.bayer or "MONO", "saturation_dn": scan.limit_dn}
    return common.model_copy(update=found)


def common_sensor(bit_depth: int) -> Sensor:
    """The noise of a common monochrome camera of so many bits, without black level."""
    return Sensor(
        bayer="MONO",
        bit_depth=bit_depth,
        black_level_dn=0.0,
        electrons_per_dn=FULL_WELL / 2**bit_depth,
        read_noise_dn=max(0.5, 2.0**bit_depth / 2000),
    )


def import_pictures(
    root: Path,
    target: Path,
    mapping: Mapping,
    calibration: Rig | None = None,
    progress: Progress | None = None,
) -> PictureScan:
    """Make a scan of a folder of pictures; an interrupted import resumes.

    Without a calibration the scan tells columns, and depth once one is given to its reconstruction. Raises
    `StoreError` naming the first picture that cannot be used or that is not the inverse it should be, or when
    the target holds another scan, and `CalibrationError` when the calibration is for other sizes.
    """
    source, progress = open_pictures(root, mapping), progress or NoProgress()
    require_pairs(source)
    sensor = sensor_of(source)
    rig = None if calibration is None else calibration.model_copy(update={"sensor": sensor})
    if rig is not None:
        _require_sizes(source, rig)
    notes = {
        "imported_from": readable(root.absolute().name),
        FINGERPRINT: source.fingerprint(),
        MAPPING: mapping.model_dump_json(),
        SENSOR: sensor.model_dump_json(),
    }
    if source.made_up:
        notes["not_captured"] = f"{' and '.join(source.made_up)}, made of the extremes of all patterns"
    refuse_other_import(target, f"the pictures of {root}, mapped like this", notes[FINGERPRINT], rig)
    camera = ReplayCamera(source, sensor.bayer, sensor.bit_depth)
    devices = DeviceRig("import", camera, ReplayProjector(source, 1000.0 / 60.0), calibration=rig)
    with ScanWriter.open(target, source.plan, devices, notes) as writer:
        _write(source, writer, progress)
    return source


def _write(source: PictureScan, writer: ScanWriter, progress: Progress) -> None:
    before = -1
    for shot in list(writer.missing()):
        progress.report("import pictures", shot.index, source.plan.shot_count)
        pixels = source.read(shot)
        found = checksum(pixels)
        # Two equal pictures are no stale frame here: drawn pictures have no noise.
        attempts = 2 if found == before else 1
        writer.write(shot, Frame(pixels, shot.exposure_ms, float(shot.index), shot.index + 1, attempts))
        before = found


def _require_sizes(source: PictureScan, rig: Rig) -> None:
    plan = source.plan
    wanted = (rig.camera.width_px, rig.camera.height_px), (rig.projector.width_px, rig.projector.height_px)
    for what, given, size in zip(
        ("pictures", "projector of the mapping"),
        (plan.camera_size_px, plan.projector_size_px),
        wanted,
        strict=True,
    ):
        if tuple(given) != size:
            raise CalibrationError(
                f"The {what} of {source.root}: {given[0]} x {given[1]} px; the calibration {rig.name!r} is"
                f" for {size[0]} x {size[1]} px. Give the calibration of these pictures, or none."
            )


def refuse_other_import(target: Path, source: str, fingerprint: str, calibration: Rig | None) -> None:
    """Raise `StoreError` when the target is a scan, but not of this ``source`` with this calibration."""
    if not (target / MANIFEST_NAME).exists():
        return
    stored, advice = read_manifest(target), "choose another name"
    if stored.notes.get(FINGERPRINT) != fingerprint:
        why = f"does not come from {source}"
    elif stored.calibration != calibration:
        which = "without a" if stored.calibration is None else "with another" if calibration else "with a"
        why = f"was imported {which} calibration"
        advice += ", or give this calibration to its reconstruction" if calibration else ""
    else:
        return
    raise StoreError(f"{target} contains a scan that {why}. A scan is never replaced: {advice}.")


def with_imported_sensor(reader: ScanReader, rig: Rig) -> Rig:
    """A calibration with the sensor of imported pictures, whose numbers are not those of the rig's camera."""
    imported = _imported_sensor(reader)
    return rig if imported is None else rig.model_copy(update={"sensor": imported})


def sensor_of_scan(reader: ScanReader) -> Sensor:
    """The sensor of imported pictures, of the scan's calibration, or a common one of the camera's bits."""
    imported, camera = _imported_sensor(reader), reader.manifest.camera
    if imported is not None:
        return imported
    if reader.calibration is not None:
        return reader.calibration.sensor
    return Sensor() if camera is None else common_sensor(camera.bit_depth)


def _imported_sensor(reader: ScanReader) -> Sensor | None:
    noted = reader.manifest.notes.get(SENSOR)
    try:
        return None if noted is None else Sensor.model_validate_json(noted)
    except ValidationError as error:
        raise StoreError(
            f"The camera of the scan {reader.folder} is not legible ({problems_in_words(error)}). Import its"
            " pictures again."
        ) from error


@dataclass(frozen=True)
class _Readout:
    sensor: Sensor
    projector_response: ProjectorResponse


def is_import(reader: ScanReader) -> bool:
    """Whether a scan was made of the pictures of another program."""
    return SENSOR in reader.manifest.notes


def decode_scan(folder: Path, progress: Progress | None = None) -> xr.Dataset:
    """Columns, rows and flags of an imported scan without calibration, with the reason for no depth.

    Raises `StoreError` when it is incomplete, `DecodeError` when its code cannot be read.
    """
    reader = ScanReader(folder)
    require_complete(reader)
    result = decode_columns_of(reader, _imported_sensor(reader) or Sensor(), progress)
    reason = (
        "No calibration of camera and projector was given, so columns have no depth. Name one with"
        " --calibration to reconstruct depth."
    )
    return result.assign_attrs(
        {**reader.manifest.notes, "captured": reader.manifest.created, NO_DEPTH: reason}
    )


@dataclass(frozen=True)
class _Captured:
    """Frames under another plan of the same shots."""

    plan: CapturePlan
    source: FrameSource

    def read(self, shot: Shot) -> NDArray[np.uint16]:
        """The frame of a shot."""
        return self.source.read(shot)


def _as_captured(source: FrameSource) -> FrameSource:
    """Frames of our own stripes as those of other programs, whose deviations follow from blur and noise."""
    plan, code = source.plan, source.plan.code
    if not isinstance(code, GrayCode | XorCode):
        return source
    base_bit = (code.base_px.bit_length() - 2) if isinstance(code, XorCode) else 0
    sets = [
        Stripes(code=code.kind, bits=(length - 1).bit_length(), base_bit=base_bit)
        for length in plan.projector_size_px
    ]
    rows = (sets[1],) if code.rows else ()
    captured = CapturedCode(column_sets=(sets[0],), row_sets=rows)
    return _Captured(plan.model_copy(update={"code": captured}), source)


@dataclass(frozen=True)
class _OneAxis:
    """The frames of one axis of a code as if they were its columns."""

    plan: CapturePlan
    source: FrameSource
    first: int

    def read(self, shot: Shot) -> NDArray[np.uint16]:
        """The frame of a shot."""
        if shot.role != "code":
            return self.source.read(shot)
        return self.source.read(replace(shot, pattern=self.first + shot.pattern))


def decode_axes(source: FrameSource, sensor: Sensor) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Columns, and rows if they are coded, of all pixels with their deviations, px, (axes, rows, columns).

    NaN where undecided. Unlike those of `decode_columns_of`, rows are as fine as the code tells them.
    """
    captured = _as_captured(source)
    plan, code = captured.plan, captured.plan.code
    assert isinstance(code, CapturedCode)
    places, stds, first = [], [], 0
    size_px = plan.projector_size_px
    for sets, size in ((code.column_sets, size_px), (code.row_sets, size_px[::-1])):
        if not sets:
            continue
        alone = plan.model_copy(update={"code": CapturedCode(column_sets=sets), "projector_size_px": size})
        found = decode_columns_of(_OneAxis(alone, captured, first), sensor)
        places.append(found["column_px"].values.astype(np.float64))
        stds.append(found["column_std_px"].values.astype(np.float64))
        first += CapturedCode(column_sets=sets).frame_count
    return np.stack(places), np.stack(stds)


def decode_columns_of(source: FrameSource, sensor: Sensor, progress: Progress | None = None) -> xr.Dataset:
    """Decoded columns (px, NaN where undecided) of any frames, their deviations, rows and flags."""
    from dsl_core.reconstruction.merge import MergedScan, decode_columns

    readout = _Readout(sensor, ProjectorResponse())
    code, white = decode_columns(MergedScan(_as_captured(source), readout), progress)
    lit = (white.radiance > LIT_SIGMAS * np.sqrt(white.variance)) | white.saturated
    flags = np.where(lit, 0, int(Flag.NO_LIGHT)).astype(np.uint16)
    flags[lit & code.undecided] |= np.uint16(int(Flag.CODE_UNSURE))
    good = flags == 0
    fine, std = code.fine_column_px, code.fine_std_px
    if fine is None or std is None:
        fine = code.likely_column.astype(np.float32)
        std = np.full(fine.shape, 12**-0.5, np.float32)
    arrays = {
        "column_px": np.where(good, fine, np.float32(np.nan)),
        "column_std_px": np.where(good, std, np.float32(np.nan)),
        "flags": flags,
    }
    if code.row is not None:
        # Rows are known also where columns are not, or not coded at all.
        arrays["row_px"] = np.where(lit & (code.row >= 0), code.row, np.nan).astype(np.float32)
    return build_result(arrays, np.empty(0), {"plan": source.plan.name})
