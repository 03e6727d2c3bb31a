"""A calibration that a person, or a rule, accepted."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import Field

from dsl_core.model.base import Record
from dsl_core.model.conditions import CaptureConditions
from dsl_core.model.figure import Figure, failures


class CalibrationNote(Record):
    """What a calibrated rig remembers of one calibration: when it was accepted and what it reached."""

    name: str
    title: str
    accepted: str
    figures: tuple[Figure, ...] = ()

    @property
    def failed(self) -> tuple[Figure, ...]:
        """The figures outside their limits."""
        return failures(self.figures)


class AcceptedCalibration(Record):
    """The outcome of one calibration with all that is needed to judge and to repeat it.

    ``accepted`` is empty while a fit still waits for a verdict. ``record`` is the recipe's own record as JSON
    values. ``based_on`` holds when the calibrations before it were accepted, so that one that was fitted on
    a superseded one is known.
    """

    schema_version: Literal[1] = 1
    name: str
    title: str
    accepted: str = ""
    captured: str = ""
    conditions: CaptureConditions | None = None
    settings: dict[str, str] = Field(default_factory=dict)
    based_on: dict[str, str] = Field(default_factory=dict)
    figures: tuple[Figure, ...] = ()
    record: dict[str, Any] = Field(default_factory=dict)

    @property
    def note(self) -> CalibrationNote:
        """What a rig remembers of it."""
        return CalibrationNote(name=self.name, title=self.title, accepted=self.accepted, figures=self.figures)
