"""Scans and calibrations in the published layout, to and from this project's own."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from dsl_core.model.rig import Rig
from dsl_core.pipeline import calibration_of, scan
from dsl_core.progress import Progress

if TYPE_CHECKING:
    from dsl_core.io.published import FileRecord


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

    Raises `StoreError` naming the first file that is needed and cannot be used; then nothing is written.
    """
    from dsl_core.devices.replay import replay_rig
    from dsl_core.io.published import open_dataset

    source = open_dataset(root, bayer=calibration.sensor.bayer, bit_depth=calibration.sensor.bit_depth)
    if target is not None:
        source.require_frames()
        scan(replay_rig(source, calibration), source.plan, target, progress, {"imported_from": root.name})
    return source.table


def import_calibration(root: Path, base: Rig, camera_size_px: tuple[int, int]) -> Rig:
    """A rig from published lenses, pose and curves on the film, sensor and scales of ``base``."""
    from dsl_core.io.published import load_calibration

    size = (base.projector.width_px, base.projector.height_px)
    return load_calibration(root, size, camera_size_px).rig(base)
