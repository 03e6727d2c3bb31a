"""Scans and calibrations in the published layout, to and from this project's own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from dsl_core.capture.preflight import require_possible
from dsl_core.devices.replay import replay_rig
from dsl_core.errors import DslError, StoreError
from dsl_core.io.published.calibration import check_calibration, holds_calibration, load_calibration
from dsl_core.io.published.dataset import PUBLISHED_SETTINGS, export_dataset, open_dataset
from dsl_core.io.published.layout import FileRecord, survey
from dsl_core.io.published.stereo_words import doubts as doubts_of
from dsl_core.io.scan.as_exposed import as_exposed
from dsl_core.io.scan.check import require_complete
from dsl_core.io.scan.folder import ScanReader
from dsl_core.model.plan import CapturePlan
from dsl_core.model.rig import Rig
from dsl_core.pipeline import scan
from dsl_core.progress import Progress
from dsl_core.words import quoted, readable
from dsl_core.workflows.captures import FINGERPRINT, refuse_other_import
from dsl_core.workflows.scans import calibration_of


def export_scan(
    folder: Path, target: Path, overwrite: bool = False, progress: Progress | None = None
) -> list[Path]:
    """Write a complete scan in the published dataset layout and return the files; raises `StoreError`.

    Its plan has the exposures in force: nothing else in that layout says what they were.
    """
    reader = as_exposed(ScanReader(folder))
    require_complete(reader)
    sensor = calibration_of(reader).sensor
    return export_dataset(
        reader, target, bayer=sensor.bayer, bit_depth=sensor.bit_depth, overwrite=overwrite, progress=progress
    )


@dataclass(frozen=True)
class FolderLook:
    """What a folder of another program holds: its table of files, and what keeps it from being imported.

    ``doubts`` are what speaks against the numbers of a calibration that can be imported.
    """

    kind: Literal["scan", "calibration"]
    table: Sequence[FileRecord]
    obstacle: str = ""
    doubts: tuple[str, ...] = ()


def look_at(
    root: Path, base: Rig, camera_size_px: tuple[int, int] | None = None, unit_mm: float = 1.0
) -> FolderLook:
    """Look at a folder in the published layout, or one that should be, without writing anything.

    Arguments as for `import_scan` and `import_calibration`. Raises `StoreError` when there is no such folder,
    or nothing in it.
    """
    if not root.is_dir():
        raise StoreError(f"{root} is not a folder. Choose the folder of a published dataset or calibration.")
    refuse_empty(root)
    if not holds_calibration(root):
        return _look_at_scan(root, base)
    table = check_calibration(root)
    try:
        _, doubts = import_calibration(root, base, camera_size_px, unit_mm=unit_mm)
    except DslError as error:
        return FolderLook("calibration", table, str(error))
    return FolderLook("calibration", table, doubts=tuple(doubts))


def refuse_empty(root: Path) -> None:
    """Raise `StoreError` for a folder in which a person sees no file, and say what is wanted instead."""
    if all(entry.name.startswith(".") for entry in root.iterdir()):
        raise StoreError(
            f"{root} is empty. Choose the folder that holds the pictures of a scan, or a published dataset"
            " or calibration."
        )


def _look_at_scan(root: Path, base: Rig) -> FolderLook:
    try:
        source = open_dataset(root, bayer=base.sensor.bayer, bit_depth=base.sensor.bit_depth)
    except DslError as error:
        # All that the layout wants is then missing, which the table says.
        plan = CapturePlan(name=root.name, settings=PUBLISHED_SETTINGS)
        return FolderLook("scan", survey(root, plan).records, f"{error}{_poses_hint(root)}")
    try:
        source.require_frames()
        require_possible(replay_rig(source, base), source.plan)
    except DslError as error:
        return FolderLook("scan", source.table, str(error))
    return FolderLook("scan", source.table)


def _poses_hint(root: Path) -> str:
    """What to do with a folder of calibration pictures, which is easily mistaken for a dataset."""
    if not any(root.glob("*/graycode_*.*")):
        return ""
    return (
        " Its folders may be poses of a board:"
        f" 'dsl-scan calibrate geometry {quoted(root)} --pictures' reads them."
    )


def import_scan(
    root: Path, target: Path | None, calibration: Rig, progress: Progress | None = None
) -> Sequence[FileRecord]:
    """Check a published dataset, make a scan of it if a target is given; return the table of files.

    An interrupted import resumes. Raises `StoreError` naming the first needed file that cannot be used,
    or when the target holds another scan; then nothing is written.
    """
    source = open_dataset(root, bayer=calibration.sensor.bayer, bit_depth=calibration.sensor.bit_depth)
    if target is not None:
        source.require_frames()
        notes = {"imported_from": readable(root.absolute().name), FINGERPRINT: source.fingerprint()}
        refuse_other_import(target, f"the files of {root}", notes[FINGERPRINT], calibration)
        scan(replay_rig(source, calibration), source.plan, target, progress, notes, prove=False)
    return source.table


def import_calibration(
    root: Path,
    base: Rig,
    camera_size_px: tuple[int, int] | None,
    projector_size_px: tuple[int, int] | None = None,
    unit_mm: float = 1.0,
) -> tuple[Rig, list[str]]:
    """A rig from published lenses, pose and curves on film, sensor and scales of ``base``, and its doubts.

    Without a size of the camera's images, that of the file is taken, and without one of the projector's, that
    of ``base``. Lengths of the file are in units of ``unit_mm``. Raises `CalibrationError`.
    """
    size = projector_size_px or (base.projector.width_px, base.projector.height_px)
    found = load_calibration(root, size, camera_size_px).in_units_of(unit_mm)
    return found.rig(base), list(doubts_of(found.stereo))
