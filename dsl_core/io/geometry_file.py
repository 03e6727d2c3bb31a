"""A geometric calibration as one JSON file, and as the published XML."""

from __future__ import annotations

from pathlib import Path

from pydantic import ValidationError

from dsl_core.errors import CalibrationError
from dsl_core.io.published.stereo import Stereo
from dsl_core.io.staging import staged
from dsl_core.model.calibration.geometry import GeometryCalibration


def save_geometry(found: GeometryCalibration, path: Path, *, overwrite: bool = False) -> Path:
    """Write a calibration, whole or not at all, and return its path; raises `StoreError`."""
    with staged([path], overwrite=overwrite) as (draft,):
        draft.write_bytes((found.model_dump_json(indent=1) + "\n").encode())
    return path


def load_geometry(path: Path) -> GeometryCalibration:
    """Read a calibration; raises `CalibrationError` that names the first field that is wrong."""
    try:
        return GeometryCalibration.model_validate_json(path.read_bytes())
    except OSError as error:
        raise CalibrationError(
            f"The calibration {path} cannot be read ({error}). Correct the path."
        ) from error
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(map(str, first["loc"])) or "file"
        raise CalibrationError(
            f"{path} is no geometric calibration: {where}: {first['msg']}. Calibrate the geometry again."
        ) from error


def as_stereo(found: GeometryCalibration) -> Stereo:
    """The lenses and the pose in the published dialect, for `save_stereo`."""
    return Stereo(camera=found.camera, projector=found.projector, pose=found.pose, rms_px=found.rms_px)
