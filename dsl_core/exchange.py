"""Scans and calibrations in the published layout, to and from this project's own."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from dsl_core.errors import StoreError
from dsl_core.model.rig import Rig
from dsl_core.pipeline import calibration_of, scan
from dsl_core.progress import Progress

if TYPE_CHECKING:
    from dsl_core.io.published import FileRecord

#: Note of a session that says from which files it was made.
_FINGERPRINT = "imported_fingerprint"


def export_scan(
    folder: Path, target: Path, overwrite: bool = False, progress: Progress | None = None
) -> list[Path]:
    """Write a complete session in the published dataset layout and return the files; raises `StoreError`."""
    from dsl_core.io.published import export_dataset
    from dsl_core.io.session import SessionReader
    from dsl_core.io.session_check import require_complete

    reader = SessionReader(folder)
    require_complete(reader)
    sensor = calibration_of(reader).sensor
    return export_dataset(
        reader, target, bayer=sensor.bayer, bit_depth=sensor.bit_depth, overwrite=overwrite, progress=progress
    )


def import_scan(
    root: Path, target: Path | None, calibration: Rig, progress: Progress | None = None
) -> Sequence[FileRecord]:
    """Check a published dataset, make a session of it if a target is given; return the table of files.

    An interrupted import goes on. Raises `StoreError` naming the first file that is needed but of no use,
    or when the target holds another scan; then nothing is written.
    """
    from dsl_core.devices.replay import replay_rig
    from dsl_core.io.published import open_dataset

    source = open_dataset(root, bayer=calibration.sensor.bayer, bit_depth=calibration.sensor.bit_depth)
    if target is not None:
        source.require_frames()
        notes = {"imported_from": root.absolute().name, _FINGERPRINT: source.fingerprint()}
        _refuse_other_scan(target, notes[_FINGERPRINT], calibration, root)
        scan(replay_rig(source, calibration), source.plan, target, progress, notes)
    return source.table


def _refuse_other_scan(target: Path, fingerprint: str, calibration: Rig, root: Path) -> None:
    """Raise `StoreError` when the target is a scan, but not of this dataset with this calibration."""
    from dsl_core.io.file_names import MANIFEST_NAME
    from dsl_core.io.session_manifest import read_manifest

    if not (target / MANIFEST_NAME).exists():
        return
    stored = read_manifest(target)
    if stored.notes.get(_FINGERPRINT) != fingerprint:
        why = f"that does not come from the files of {root}"
    elif stored.calibration != calibration:
        why = "that was imported with another calibration"
    else:
        return
    raise StoreError(f"{target} holds a scan {why}. A scan is never replaced: choose another name.")


def import_calibration(root: Path, base: Rig, camera_size_px: tuple[int, int]) -> Rig:
    """A rig from published lenses, pose and curves on the film, sensor and scales of ``base``."""
    from dsl_core.io.published import load_calibration

    size = (base.projector.width_px, base.projector.height_px)
    return load_calibration(root, size, camera_size_px).rig(base)
