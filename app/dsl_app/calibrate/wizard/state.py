"""One calibration while a person goes through it step by step."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from dsl_app.calibrate.wizard.ghost import LEAST_SHARED, PointsPx
from dsl_app.shared.evented import Event, Value
from dsl_app.shared.jobs.base import JobProgress
from dsl_core.campaign.session import CalibrationSession, StepStatus
from dsl_core.model.base import Record
from dsl_core.model.calibration.accepted import AcceptedCalibration
from dsl_core.model.figure import Figure, failures


class Doing(Enum):
    """What the wizard is doing now; the words are shown."""

    OPENING = "opening"
    IDLE = ""
    LOOKING = "looking"
    READING = "reading the picture"
    CAPTURING = "capturing"
    STOPPING = "stopping"
    FITTING = "fitting"
    KEEPING = "writing"

    @property
    def is_long(self) -> bool:
        """Whether a person has to wait for it, or stop it."""
        return self in (Doing.OPENING, Doing.CAPTURING, Doing.STOPPING, Doing.FITTING, Doing.KEEPING)


@dataclass(frozen=True)
class Look:
    """What the last look at a step found; ``trouble`` is why nothing could be measured.

    ``points_px`` are points of the target in the camera's picture, and ``shared`` how well they cover the
    outline where it is wanted, 0 to 1.
    """

    key: str
    figures: tuple[Figure, ...] = ()
    trouble: str = ""
    points_px: PointsPx = ()
    shared: float = 0.0

    @property
    def is_good(self) -> bool:
        """Whether everything is as it should be."""
        return not self.trouble and not failures(self.figures)

    @property
    def is_in_place(self) -> bool:
        """Whether the target is where its outline is."""
        return self.shared >= LEAST_SHARED


@dataclass(frozen=True)
class Fit:
    """A fit with its record; ``session`` is what it was made in."""

    fitted: AcceptedCalibration
    record: Record
    session: CalibrationSession
    is_accepted: bool = False


@dataclass(frozen=True)
class SettingRow:
    """A setting of the recipe as text; ``doc`` explains it, ``kind`` chooses how it is edited.

    ``used`` is what an empty field stands for where the rig decides that; ``understood`` says how a list of
    numbers was read, as a comma parts numbers and is no decimal sign.
    """

    key: str
    kind: str
    default: str
    value: str
    doc: str
    used: str = ""
    understood: str = ""


@dataclass(frozen=True)
class Seen:
    """A frame as people look at it: RGB, and the share of raw pixels at full scale."""

    picture: NDArray[np.uint8]
    saturated: float


class WizardState:
    """Values that a wizard's controller sets and its window follows.

    ``at`` counts pages: 0 are the settings, 1 to n the steps, n + 1 the fit. ``trouble`` is what went wrong
    and what to do about it, ``note`` what was done last. ``misfit`` is the session whose captures gave no
    fit. ``allowed`` are figures that a person accepts although some are outside their limits.
    ``is_automatic`` runs all steps without a person. ``outlines`` are where targets are wanted in the
    camera's picture, by the keys of steps; a target that is right and still there is captured by itself if
    ``captures_itself``, once ``is_awaited``: a person asked for checks, or moved it since the wizard opened.
    ``covered`` are the points of what was captured since the wizard opened. ``closed``
    fires once, when the last work ended.
    """

    def __init__(self, name: str, title: str) -> None:
        self.name, self.title = name, title
        self.doing = Value(Doing.OPENING)
        self.statuses: Value[tuple[StepStatus, ...]] = Value(())
        self.at = Value(0)
        self.is_checking = Value(False)
        self.look: Value[Look | None] = Value(None)
        self.seen: Value[Seen | None] = Value(None)
        self.progress = Value(JobProgress())
        self.trouble = Value("")
        self.can_reconnect = Value(False)
        self.note = Value("")
        self.fit: Value[Fit | None] = Value(None)
        self.misfit: Value[CalibrationSession | None] = Value(None)
        self.allowed: Value[tuple[Figure, ...]] = Value(())
        self.settings: Value[tuple[SettingRow, ...]] = Value(())
        self.settings_trouble = Value("")
        self.places_itself = Value(False)
        self.is_automatic = Value(False)
        self.outlines: Value[Mapping[str, PointsPx]] = Value({})
        self.captures_itself = Value(True)
        self.is_awaited = Value(False)
        self.covered: Value[PointsPx] = Value(())
        #: The calibration that comes after this one, and whether a person goes on to it; empty: none.
        self.following, self.following_title = "", ""
        self.goes_on = False
        #: Whether a capture that is stopped goes on after its last frame.
        self.keeps_frames = True
        self.closed: Event[None] = Event()
        self.fit.changed.connect(self._forget_allowed)

    def _forget_allowed(self, fit: Fit | None) -> None:
        """What was allowed of one fit is not allowed of another."""
        if fit is None or fit.fitted.figures != self.allowed.value:
            self.allowed.set(())

    @property
    def last(self) -> int:
        """The page of the fit."""
        return len(self.statuses.value) + 1

    @property
    def status(self) -> StepStatus | None:
        """The step that is shown; None on the pages of settings and fit."""
        at = self.at.value
        return self.statuses.value[at - 1] if 1 <= at < self.last else None

    @property
    def outline(self) -> PointsPx:
        """Where the target of the step that is shown is wanted; empty where that is not known."""
        status = self.status
        return () if status is None else self.outlines.value.get(status.step.key, ())

    @property
    def waits_for_person(self) -> bool:
        """Whether a person is to bring a target into an outline, which is captured by itself then."""
        status = self.status
        is_open = status is not None and status.state != "captured"
        return is_open and bool(self.outline) and not self.places_itself.value

    @property
    def will_capture_itself(self) -> bool:
        """Whether the target is captured without a click as soon as it is right and still."""
        is_asked = self.is_checking.value and self.captures_itself.value and self.is_awaited.value
        return is_asked and self.waits_for_person

    @property
    def may_accept(self) -> bool:
        """Whether a fit waits whose figures are within their limits, or allowed by the person."""
        fit = self.fit.value
        if fit is None or fit.is_accepted:
            return False
        return not failures(fit.fitted.figures) or self.allowed.value == fit.fitted.figures

    @property
    def lacking(self) -> tuple[int, ...]:
        """The pages of steps without good captures."""
        return tuple(i for i, each in enumerate(self.statuses.value, 1) if each.state != "captured")
