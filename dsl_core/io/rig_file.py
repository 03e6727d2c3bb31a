"""A calibrated rig as one JSON file."""

from __future__ import annotations

import json
from pathlib import Path

from pydantic import ValidationError

from dsl_core.errors import CalibrationError
from dsl_core.io.staging import staged
from dsl_core.model.plan import CapturePlan
from dsl_core.model.rig import Rig

_MOST_PROBLEMS = 5
_SCHEMA_VERSION = 1


def save_rig(rig: Rig, path: Path, *, overwrite: bool = False) -> Path:
    """Write a rig, whole or not at all, and return its path.

    Raises `StoreError` when the file exists already (unless ``overwrite``) or cannot be written.
    """
    with staged([path], overwrite=overwrite) as (draft,):
        draft.write_bytes((rig.model_dump_json(indent=1) + "\n").encode())
    return path


def load_rig(path: Path) -> Rig:
    """Read a rig; raises `CalibrationError` that names every field that is wrong."""
    try:
        text = path.read_bytes().decode("utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise CalibrationError(
            f"The calibration {path} cannot be read ({error}). Give the path of a rig's JSON file."
        ) from error
    _check_version(text, path)
    try:
        return Rig.model_validate_json(text)
    except ValidationError as error:
        raise CalibrationError(
            f"The calibration {path} is not valid: {_sentence(error)}. Correct the fields or calibrate again."
        ) from error


def check_rig_fits(rig: Rig, plan: CapturePlan) -> None:
    """Raise `CalibrationError` when a rig was calibrated for other image sizes than the plan's."""
    pairs = (
        ("camera", (rig.camera.width_px, rig.camera.height_px), plan.camera_size_px),
        ("projector", (rig.projector.width_px, rig.projector.height_px), plan.projector_size_px),
    )
    wrong = [
        f"the {part} of the calibration has {ours[0]} x {ours[1]} px,"
        f" that of the scan {theirs[0]} x {theirs[1]} px"
        for part, ours, theirs in pairs
        if ours != tuple(theirs)
    ]
    if wrong:
        raise CalibrationError(
            f"The calibration {rig.name!r} does not fit the scan {plan.name!r}: {' and '.join(wrong)}."
            " Use the calibration made with the scan's binning and crop, or calibrate again with them."
        )


def _check_version(text: str, path: Path) -> None:
    """Name another schema version before its many unknown fields are named."""
    try:
        content = json.loads(text)
    except ValueError as error:
        raise CalibrationError(
            f"The calibration {path} is not JSON ({error}). The file may be cut off; restore it from a copy."
        ) from error
    if not isinstance(content, dict):
        raise CalibrationError(f"The calibration {path} does not hold a rig: a JSON object is wanted.")
    version = content.get("schema_version", _SCHEMA_VERSION)
    if version != _SCHEMA_VERSION:
        raise CalibrationError(
            f"The calibration {path} has schema version {version!r}; this program knows version"
            f" {_SCHEMA_VERSION}. Use the version of the program that wrote it."
        )


def _sentence(error: ValidationError) -> str:
    problems = [
        f"{'.'.join(map(str, item['loc'])) or 'rig'}: {item['msg']} (given {_short(item['input'])})"
        for item in error.errors()
    ]
    more = len(problems) - _MOST_PROBLEMS
    return "; ".join(problems[:_MOST_PROBLEMS]) + (f"; and {more} more" if more > 0 else "")


def _short(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 40 else text[:37] + "..."
