"""A calibration that a person, or a rule, accepted."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from typing import Any, Literal

from pydantic import Field

from dsl_core.model.attributes import sentences_of
from dsl_core.model.base import Record
from dsl_core.model.conditions import CaptureConditions
from dsl_core.model.figure import Figure, failures

#: Name of the attribute of a result that holds what its rig's calibrations missed, as JSON.
MISSED_ATTRIBUTE = "calibration_missed"
#: Names are those of files.
LONGEST = 100
#: Name of the figure that says how far held-out first orders lie from where the film's record puts them, px.
HELD_OUT_ORDERS = "held-out error of first orders"


class CalibrationNote(Record):
    """What a calibrated rig remembers of one calibration: when it was accepted and what it reached.

    ``captured`` is when its pictures were taken, empty where nobody noted it: they may have been fitted again
    long after. ``light`` is when those were taken that say how bright the light is, empty for a calibration
    without any.
    """

    name: str
    title: str
    accepted: str
    captured: str = ""
    light: str = ""
    figures: tuple[Figure, ...] = ()

    @property
    def measured(self) -> str:
        """When the rig was as this calibration says."""
        return self.captured or self.accepted

    @property
    def failed(self) -> tuple[Figure, ...]:
        """The figures outside their limits."""
        return failures(self.figures)

    @property
    def missed(self) -> tuple[str, ...]:
        """A sentence for each figure that missed its limit and was accepted all the same.

        >>> from dsl_core.model.figure import Figure
        >>> error = Figure(name="error", value=0.6, unit="px", high=0.5)
        >>> CalibrationNote(name="geometry", title="Geometry", accepted="", figures=(error,)).missed
        ("This rig's calibration 'Geometry' missed its limit: error 0.600 px (limit: at most 0.5 px).",)
        """
        return tuple(
            f"This rig's calibration {self.title!r} missed its limit: {figure} (limit: {figure.limits})."
            for figure in self.failed
        )


def missed_limits(notes: Iterable[CalibrationNote]) -> tuple[str, ...]:
    """Sentences on all figures of a rig's calibrations that are outside their limits."""
    return tuple(sentence for note in notes for sentence in note.missed)


def missed_attributes(notes: Iterable[CalibrationNote]) -> dict[str, str]:
    """The attributes by which a result remembers them; none where all limits were reached."""
    found = missed_limits(notes)
    return {MISSED_ATTRIBUTE: json.dumps(found, ensure_ascii=False)} if found else {}


def read_missed(attributes: Mapping[str, object]) -> tuple[str, ...]:
    """The sentences that a result's attributes hold, none where there are none that can be read."""
    return sentences_of(attributes, MISSED_ATTRIBUTE)


class AcceptedCalibration(Record):
    """The outcome of one calibration with all that is needed to judge and to repeat it.

    ``accepted`` is empty while a fit still waits for a verdict. ``record`` is the recipe's own record as JSON
    values. ``based_on`` holds when the calibrations before it were accepted, so that one that was fitted on
    a superseded one is known.
    """

    schema_version: Literal[1] = 1
    name: str = Field(min_length=1, max_length=LONGEST, pattern=r"^[^/\\\x00]+$")
    title: str
    accepted: str = ""
    captured: str = ""
    light: str = ""
    conditions: CaptureConditions | None = None
    settings: dict[str, str] = Field(default_factory=dict)
    based_on: dict[str, str] = Field(default_factory=dict)
    figures: tuple[Figure, ...] = ()
    record: dict[str, Any] = Field(default_factory=dict)

    @property
    def note(self) -> CalibrationNote:
        """What a rig remembers of it."""
        return CalibrationNote(
            name=self.name,
            title=self.title,
            accepted=self.accepted,
            captured=self.captured,
            light=self.light,
            figures=self.figures,
        )
