"""A calibrated rig as one JSON file."""

from __future__ import annotations

from pathlib import Path

from dsl_core.errors import CalibrationError
from dsl_core.io.records import read_record, write_record
from dsl_core.model.rig import Rig


def save_rig(rig: Rig, path: Path, *, overwrite: bool = False) -> Path:
    """Write a rig, whole or not at all, and return its path.

    Raises `StoreError` when the file already exists (unless ``overwrite``) or cannot be written.
    """
    return write_record(path, rig, overwrite=overwrite)


def load_rig(path: Path) -> Rig:
    """Read a rig; raises `CalibrationError` that names the fields that are wrong."""
    remedy = "Correct the file, give that of another rig, or calibrate again."
    return read_record(
        path, Rig, remedy, called="The calibration", fault="is not valid", error=CalibrationError, most=5
    )
