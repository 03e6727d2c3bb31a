"""What a calibration is made of: steps with a target each, a look, a capture, a fit.

A recipe knows the order and the judgement of one calibration; it holds no state. The captures of a step are
in its folder, so that an interrupted calibration can continue where it stopped.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from dsl_core.capture.again import Again
from dsl_core.devices.base import DeviceRig
from dsl_core.errors import CalibrationError, Cancelled, DslError, StoreError
from dsl_core.io import MANIFEST_NAME
from dsl_core.io.atomic import make_folder
from dsl_core.io.campaign_folder import SCAN_NAME
from dsl_core.io.records import read_record, replace_record
from dsl_core.io.scan.as_exposed import as_exposed
from dsl_core.io.scan.folder import ScanReader
from dsl_core.model.base import Record
from dsl_core.model.figure import Figure
from dsl_core.model.placement import Placement
from dsl_core.model.plan import CapturePlan
from dsl_core.model.rig import Rig
from dsl_core.progress import Progress

RecordT = TypeVar("RecordT", bound=Record)
#: Told where points of a target are in the camera's picture: columns and rows, px, shape (points, 2).
Found = Callable[[NDArray[np.float64]], object]


def _ignore(points_px: NDArray[np.float64]) -> None:
    """Nobody watches."""


@dataclass(frozen=True)
class Step:
    """One placement of a target and what is captured of it.

    ``key`` names the folder of the captures (letters, digits, ``-``, ``.``); ``instruction`` tells a person
    in a sentence or two what to place and how.
    """

    key: str
    title: str
    instruction: str
    placement: Placement


@dataclass(frozen=True)
class Bench:
    """What a recipe works with.

    ``rig`` is what is known so far, nominal where nothing has been measured yet. ``folder`` is the recipe's
    own; each step has a folder in it, with at most one scan and records next to it. ``found`` is told by a
    look where it found points of the target.
    """

    devices: DeviceRig
    folder: Path
    rig: Rig
    found: Found = _ignore

    def step_folder(self, step: Step) -> Path:
        """The folder of a step's captures; it need not exist."""
        return self.folder / step.key

    def is_scanned(self, step: Step) -> bool:
        """Whether the scan of a step is complete."""
        return self._is_begun(step) and not self.scan_of(step).missing()

    def scan_of(self, step: Step) -> ScanReader:
        """The scan of a step, with the exposures in force; raises `StoreError`."""
        return as_exposed(self._as_planned(step))

    def scan(self, step: Step, make_plan: Callable[[], CapturePlan], progress: Progress) -> CapturePlan:
        """Scan a step and return the plan; a scan that was begun continues with its own plan."""
        from dsl_core import pipeline

        folder = self.step_folder(step)
        if self._is_begun(step):
            plan = self._as_planned(step).plan
        else:
            plan = pipeline.fit_plan(make_plan(), self.devices)
            make_folder(folder)
        pipeline.scan(self.devices, plan, folder / SCAN_NAME, progress, again=Again.STEP)
        return plan

    def keep(self, step: Step, name: str, record: Record) -> None:
        """Write a record into a step's folder; raises `StoreError`."""
        replace_record(self.step_folder(step) / name, record)

    def kept(self, step: Step, name: str, kind: type[RecordT]) -> RecordT:
        """A record that `keep` wrote; raises `StoreError`."""
        return read_record(self.step_folder(step) / name, kind)

    def _as_planned(self, step: Step) -> ScanReader:
        return ScanReader(self.step_folder(step) / SCAN_NAME)

    def _is_begun(self, step: Step) -> bool:
        return (self.step_folder(step) / SCAN_NAME / MANIFEST_NAME).exists()


class Recipe(ABC, Generic[RecordT]):
    """One kind of calibration; its settings are the fields of the dataclass that implements it.

    ``name`` is its name on the command line and that of its folder, such as ``bandpass``; ``title`` is the
    wizard's, such as ``Bandpass filters``; ``needs`` are the names of the calibrations that must be accepted
    before; ``keeps_frames`` says that a capture that was stopped goes on after its last frame, and not
    from the beginning; ``record_type`` is what `fit` returns, which is stored as JSON. Every
    `CalibrationError` names the step concerned.
    """

    name: str
    title: str
    needs: tuple[str, ...] = ()
    keeps_frames: bool = True
    record_type: type[RecordT]

    @abstractmethod
    def steps(self, bench: Bench) -> tuple[Step, ...]:
        """The steps in their order."""

    def reason_to_omit(self, rig: Rig) -> str:
        """Why all calibrations of a rig go without this one: a sentence, empty where they do not."""
        return ""

    @abstractmethod
    def look(self, bench: Bench, step: Step) -> tuple[Figure, ...]:
        """Check with a few frames, which are not kept, that the target is right: found, even, unsaturated.

        Costs at most a second or two, so that a wizard can repeat it while a person moves the target.
        """

    def is_captured(self, bench: Bench, step: Step) -> bool:
        """Whether the captures of a step, a scan unless a recipe says otherwise, are complete."""
        return bench.is_scanned(step)

    def measures_light(self, step: Step) -> bool:
        """Whether the captures of a step say how bright the light of the calibrated rig is."""
        return False

    def acts_at_capture(self, step: Step) -> dict[str, float]:
        """Settings, by name, that only a capture of a step heeds: what is captured keeps those it had."""
        return {}

    @abstractmethod
    def capture(self, bench: Bench, step: Step, progress: Progress) -> None:
        """Capture a step into its folder; continues captures that an earlier call left unfinished."""

    @abstractmethod
    def fit(self, bench: Bench, progress: Progress) -> RecordT:
        """Calibrate from the captures of all steps; the devices are not used."""

    def is_current(self, record: Mapping[str, Any]) -> bool:
        """Whether files that settings name still say what the ``record`` of a fit, as JSON, was made from."""
        return True

    @abstractmethod
    def figures(self, record: RecordT, done: Collection[str] = ()) -> tuple[Figure, ...]:
        """The key figures of a fit against their limits.

        ``done`` are the names of the calibrations that it was fitted on, which advice need not name.
        """

    @abstractmethod
    def apply(self, record: RecordT, rig: Rig) -> Rig:
        """What is known of the rig once this calibration is accepted."""


#: A recipe whose record nobody asks for by its type.
AnyRecipe = Recipe[Any]


@contextmanager
def naming(step: Step) -> Iterator[None]:
    """Make errors of the block name the step; one of a file names the file already."""
    try:
        yield
    except (Cancelled, StoreError):
        raise
    except DslError as error:
        raise CalibrationError(f"{step.title}: {error}") from error
