"""A calibrated rig as one JSON file."""

from __future__ import annotations

import json
from pathlib import Path

from pydantic import ValidationError

from dsl_core.errors import CalibrationError
from dsl_core.io.staging import write_record
from dsl_core.model.rig import Rig

_MOST_PROBLEMS = 5
_SCHEMA_VERSION = 1


def save_rig(rig: Rig, path: Path, *, overwrite: bool = False) -> Path:
    """Write a rig, whole or not at all, and return its path.

    Raises `StoreError` when the file already exists (unless ``overwrite``) or cannot be written.
    """
    return write_record(path, rig, overwrite=overwrite)


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


def _check_version(text: str, path: Path) -> None:
    """Name another schema version before its many unknown fields are named."""
    try:
        content = json.loads(text)
    except ValueError as error:
        raise CalibrationError(
            f"The calibration {path} is not JSON ({error}). The file may be cut off; restore it from a copy."
        ) from error
    if not isinstance(content, dict):
        raise CalibrationError(f"The calibration {path} does not contain a rig: a JSON object is needed.")
    version = content.get("schema_version", _SCHEMA_VERSION)
    if version != _SCHEMA_VERSION:
        raise CalibrationError(
            f"The calibration {path} has schema version {version!r}; this program supports version"
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
