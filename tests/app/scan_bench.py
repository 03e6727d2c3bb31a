"""A connected twin with a scan controller, for tests of the Scan page."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

from app.controllers.rig import RigController
from app.controllers.scan import ScanController
from app.jobs.base import InlineRunner, JobRunner
from app.state.rig import RigChoice, RigState
from app.state.scan import ScanState
from app.state.undo import UndoStack
from app.views import RecordingNotifier
from dsl_core.io.calibration_library import CalibrationLibrary
from dsl_core.model.plan import CapturePlan
from dsl_core.model.presets import PRESETS

TWIN = RigChoice("twin", (("scene", "color-checker"), ("size", "64x48")))
SHORT = PRESETS[0].plan


@dataclass
class ScanBench:
    """Everything a test of scans touches."""

    state: ScanState
    rig: RigController
    scans: ScanController
    notifier: RecordingNotifier
    undo: UndoStack
    library: CalibrationLibrary

    def plan(self, plan: CapturePlan = SHORT) -> None:
        """Plan a short scan without reconstruction."""
        self.state.then_reconstruct.set(False)
        self.scans.plans.change_plan(plan)


def make_bench(folder: Path, runner: JobRunner | None = None) -> ScanBench:
    """A bench whose rig is not yet connected."""
    runner, notifier, undo = runner or InlineRunner(), RecordingNotifier(), UndoStack()
    state = ScanState(CapturePlan(), folder / "first.dsl")
    rig = RigController(RigState(TWIN), runner, notifier)
    library = CalibrationLibrary(folder / "library")
    clock = lambda: datetime(2026, 3, 1, 10, 20)  # noqa: E731
    scans = ScanController(state, rig, runner, notifier, undo, library, clock)
    return ScanBench(state, rig, scans, notifier, undo, library)
