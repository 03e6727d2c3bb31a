"""What is in front of the camera during a step of a calibration."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from dsl_core.model.base import Record

Target = Literal["as it is", "nothing", "board", "spectralon", "color-checker"]


class Placement(Record):
    """A target and what is in the beam; a person puts it there, or the twin's own hand.

    ``options`` are those of the twin's scene of the same name (such as ``depth_mm``, ``tilt_x_deg``), which
    a person reads in the step's instruction. ``filter_nm`` is the nominal centre of the bandpass filter
    before the camera, None for no filter.
    """

    target: Target = "as it is"
    film: bool = True
    filter_nm: float | None = None
    options: dict[str, float | str] = Field(default_factory=dict)
