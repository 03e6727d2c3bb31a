"""The state of the Scan page: plan, cost, progress and the latest frame."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from dsl_app.connection.state import RigChoice
from dsl_app.shared.evented import Event, Value
from dsl_core.capture.preview import BlockGraph
from dsl_core.capture.runner import State, Status
from dsl_core.model.plan import CapturePlan, Setting, Shot
from dsl_core.model.presets import PRESETS, Preset, on_columns, on_cycles

#: The longest exposure that is offered while no camera says its own.
LONGEST_MS = 30_000.0


class Phase(Enum):
    """Phases of a scan; the values are shown."""

    PLANNING = "ready"
    STARTING = "starting"
    RUNNING = "scanning"
    PAUSED = "paused"
    STOPPING = "stopping"
    DONE = "complete"
    STOPPED = "stopped"
    LOST = "interrupted"

    @property
    def is_busy(self) -> bool:
        """Whether a scan uses the rig now."""
        return self in (Phase.STARTING, Phase.RUNNING, Phase.PAUSED, Phase.STOPPING)


class Reconnection(Enum):
    """Reconnection of a rig that was lost during a scan; the scan resumes by itself only when `RESUMING`."""

    NONE = "not lost"
    TRYING = "reconnecting"
    RESUMING = "reconnecting to resume the scan"
    GIVEN_UP = "not connected"
    BACK = "reconnected"

    @property
    def is_trying(self) -> bool:
        """Whether the rig is being reconnected."""
        return self in (Reconnection.TRYING, Reconnection.RESUMING)

    @property
    def is_away(self) -> bool:
        """Whether the rig must be connected before the scan resumes."""
        return self.is_trying or self is Reconnection.GIVEN_UP


@dataclass(frozen=True)
class CalibrationChoice:
    """A calibration to scan with: ``key`` is its name in the library, empty for the rig's own."""

    key: str
    name: str
    date: str = ""

    @property
    def text(self) -> str:
        """Name and date as people read them."""
        where = self.name if self.key or self == OWN_CALIBRATION else f"{self.name} (the rig's own)"
        return f"{where}, {self.date[:10]}" if self.date else where

    @property
    def in_use(self) -> str:
        """A sentence that scans use it."""
        return f"Scans use {self.name if self.key else 'the calibration of the rig itself, if it has one'}."


OWN_CALIBRATION = CalibrationChoice("", "none")


@dataclass(frozen=True)
class InterruptedScan:
    """A scan that lacks frames, and the rig it was captured with (None: unknown).

    A rig of another computer is not opened only because a file names it: then ``may_open`` is False. The scan
    keeps its ``calibration``, which is named here.
    """

    folder: Path
    done: int
    total: int
    rig: RigChoice | None = None
    may_open: bool = False
    calibration: str = OWN_CALIBRATION.name

    @property
    def rig_to_open(self) -> RigChoice | None:
        """The rig to connect before the scan resumes, if that can be done without asking."""
        return self.rig if self.may_open else None

    @property
    def words(self) -> str:
        """How far it came and with which rig, as one sentence."""
        which = f" It was captured with {self.rig.words}." if self.rig is not None else ""
        return f"{self.folder.stem}: {self.done} of {self.total} frames are safe.{which}"


@dataclass(frozen=True)
class Facts:
    """The cost of a plan, ``obstacles`` that prevent it from starting, and ``remarks`` that do not.

    ``connects`` says that starting connects the rig first, ``is_calibrated`` that the scan can be
    reconstructed once it is complete.
    """

    frames: int
    seconds: float
    needed_bytes: int
    free_bytes: int
    obstacles: tuple[str, ...] = ()
    remarks: tuple[str, ...] = ()
    settings_differ: bool = False
    connects: bool = False
    is_calibrated: bool = True


@dataclass(frozen=True)
class LivePicture:
    """The last frame of a ``plan`` as RGB, one pixel for ``cell_px`` camera pixels.

    ``brightest`` is what its brightest pixels reach of full scale, ``saturated`` the share of pixels there.
    """

    plan: CapturePlan
    shot: Shot
    picture: NDArray[np.uint8]
    cell_px: int
    brightest: float = 0.0
    saturated: float = 0.0


class ScanState:
    """Values that the scan's controller sets and the page follows.

    ``trouble`` says what interrupted the scan (empty: nothing), ``note`` how the last one ended.
    ``plan_file`` is the file that holds exactly the current plan, if there is one. ``check_drift`` compares
    two old frames before an interrupted scan resumes. ``meters`` measures the scene before a new scan and
    scales exposures to it, where nobody chose them. ``period_ms`` is the LED cycle of the rig's projector,
    ``longest_ms`` the longest exposure of its camera. ``finished`` is the scan that was completed last,
    ``result`` fires with each new result; ``lacks_calibration`` says of the one completed last that it
    contains no calibration to be reconstructed with; ``is_reconstructing`` says that one is being made, and
    ``depth`` is that of it, mm, while its spectra are computed; ``reconstruction_s`` is how long one of the
    plan is expected to take.
    ``refused`` fires with a calibration that was chosen and cannot be read; the one before stays in use.
    ``is_seen`` says that the page is on screen, where everything is said; ``wanted`` asks for it.
    """

    def __init__(self, plan: CapturePlan, target: Path) -> None:
        self.plan = Value(plan)
        self.plan_file: Value[Path | None] = Value(None)
        self.target = Value(target)
        self.calibrations: Value[tuple[CalibrationChoice, ...]] = Value((OWN_CALIBRATION,))
        self.calibration = Value(OWN_CALIBRATION)
        self.refused: Event[CalibrationChoice] = Event()
        self.override = Value(False)
        self.check_drift = Value(True)
        self.meters = Value(True)
        self.then_reconstruct = Value(True)
        self.interrupted: Value[InterruptedScan | None] = Value(None)
        self.finished: Value[Path | None] = Value(None)
        self.lacks_calibration = Value(False)
        self.facts: Value[Facts | None] = Value(None)
        self.period_ms = Value(1000.0 / 60.0)
        self.longest_ms = Value(LONGEST_MS)
        self.latency_ms = Value(0.0)
        self.phase = Value(Phase.PLANNING)
        self.status = Value(Status(State.IDLE))
        self.trouble = Value("")
        self.reconnection = Value(Reconnection.NONE)
        self.note = Value("")
        self.picture: Value[LivePicture | None] = Value(None)
        self.cursor: Value[tuple[int, int] | None] = Value(None)
        self.graph: Value[BlockGraph | None] = Value(None)
        self.result: Event[Path] = Event()
        self.is_reconstructing = Value(False)
        self.depth: Value[NDArray[np.float32] | None] = Value(None)
        self.reconstruction_s: Value[float | None] = Value(None)
        self.is_seen = Value(False)
        self.wanted: Event[None] = Event()

    @property
    def has_library(self) -> bool:
        """Whether the library has a calibration to choose."""
        return any(each.key for each in self.calibrations.value)

    @property
    def preset(self) -> Preset | None:
        """The preset that the plan equals; None for a custom plan."""
        return preset_of(self.plan.value, self.period_ms.value)

    @property
    def can_be_metered(self) -> bool:
        """Whether exposures are those of a preset: others were chosen by a person, here or in a file."""
        is_new = self.interrupted.value is None and self.plan_file.value is None
        return is_new and self.preset is not None

    @property
    def is_metered(self) -> bool:
        """Whether the scan scales its exposures to the scene."""
        return self.meters.value and self.can_be_metered


def preset_of(plan: CapturePlan, period_ms: float) -> Preset | None:
    """The preset that a plan equals, on a projector with this frame period."""
    for preset in PRESETS:
        wanted = on_columns(on_cycles(preset.plan, period_ms), plan.projector_size_px[0])
        same_patterns = (plan.code, plan.spectral) == (wanted.code, wanted.spectral)
        if same_patterns and same_settings(plan.settings, wanted.settings):
            return preset
    return None


def same_settings(first: Sequence[Setting], second: Sequence[Setting]) -> bool:
    """Whether settings are equal up to the rounding to whole cycles."""
    return len(first) == len(second) and all(
        a.level == b.level and math.isclose(a.exposure_ms, b.exposure_ms, rel_tol=1e-9)
        for a, b in zip(first, second, strict=True)
    )


def same_plan(first: CapturePlan, second: CapturePlan) -> bool:
    """Whether plans are equal up to the rounding to whole cycles."""
    alike = first.model_copy(update={"settings": second.settings}) == second
    return alike and same_settings(first.settings, second.settings)
