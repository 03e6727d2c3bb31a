"""What accuracy costs in time: a table of measured plans that comes with the program."""

from __future__ import annotations

from typing import Literal

from pydantic import ValidationError

from dsl_core.errors import StoreError
from dsl_core.model.base import Record
from dsl_core.resources import resource_path

TABLE = "operating_points.json"


class OperatingPoint(Record):
    """What one plan reached; ``seconds`` on the rig it was measured with, latency included."""

    frames: int
    seconds: float
    chart_rmse: float
    chart_pixel_rmse: float
    filter_fwhm_nm: float
    depth_rmse_mm: float
    depth_coverage: float


class OperatingPoints(Record):
    """Points by the keys of the presets, and ``origin``: a sentence on how they were measured."""

    schema_version: Literal[1] = 1
    origin: str
    points: dict[str, OperatingPoint]


def load_operating_points() -> OperatingPoints:
    """The table of this installation; raises `StoreError`."""
    path = resource_path(TABLE)
    try:
        return OperatingPoints.model_validate_json(path.read_bytes())
    except (OSError, ValidationError) as error:
        raise StoreError(f"{path} cannot be read ({error}). Install dsl-scan again.") from error
