"""A connected twin with a scan controller, for tests of the Scan page."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING

from dsl_app.connection.controller import RigController
from dsl_app.connection.state import RigChoice, RigState
from dsl_app.scan.controller import ScanController
from dsl_app.scan.forecast.controller import ForecastController
from dsl_app.scan.forecast.state import ForecastState
from dsl_app.scan.state import ScanState
from dsl_app.shared.jobs.base import JobRunner
from dsl_app.shared.undo import UndoStack

from dsl_core.io.calibration_library import CalibrationLibrary
from dsl_core.model.plan import CapturePlan, LineComb, Sentinels
from dsl_core.model.presets import PRESETS
from dsl_core.model.rig import Rig
from tests.app.support.doubles import InlineRunner, RecordingNotifier

if TYPE_CHECKING:
    from dsl_core.planning.expected import Prediction

TWIN = RigChoice("twin", (("scene", "color-checker"), ("size", "64x48")))
#: A rig of another size.
SMALL = RigChoice("twin", (("scene", "color-checker"), ("size", "32x24")))
SHORT = PRESETS[0].plan
#: The same at one setting: half of the frames tell as much of who captures them.
BRIEF = SHORT.model_copy(update={"settings": SHORT.settings[1:], "code_settings": (0,)})
#: All frames of the brief plan, and its patterns.
FRAMES, PATTERNS = BRIEF.shot_count, BRIEF.spectral_count
COMB = CapturePlan(name="comb 5x2x64", spectral=LineComb(period_px=64))


@dataclass
class ScanBench:
    """Everything a test of scans touches."""

    state: ScanState
    rig: RigController
    scans: ScanController
    notifier: RecordingNotifier
    undo: UndoStack
    library: CalibrationLibrary

    @property
    def calibration(self) -> Rig:
        """The calibration of the rig that is connected."""
        devices = self.rig.state.devices.value
        assert devices is not None
        assert devices.calibration is not None
        return devices.calibration

    def plan(self, plan: CapturePlan = BRIEF) -> None:
        """Plan a brief scan without reconstruction."""
        self.state.then_reconstruct.set(False)
        self.scans.plans.change_plan(plan)


def make_bench(folder: Path, runner: JobRunner | None = None) -> ScanBench:
    """A bench whose rig is not yet connected."""
    notifier, undo = RecordingNotifier(), UndoStack()
    runner = runner or InlineRunner(notifier)
    state = ScanState(CapturePlan(sentinels=Sentinels()), folder / "first.dsl")
    rig = RigController(RigState(TWIN), runner, notifier)
    library = CalibrationLibrary(folder / "library")
    clock = lambda: datetime(2026, 3, 1, 10, 20)  # noqa: E731
    scans = ScanController(state, rig, runner, notifier, undo, library, clock, hidden=folder / "demo")
    return ScanBench(state, rig, scans, notifier, undo, library)


def planned_bench(folder: Path) -> ScanBench:
    """A bench with its rig connected and a brief scan planned."""
    made = make_bench(folder)
    made.rig.connect(TWIN)
    made.plan()
    return made


def make_forecast(
    bench: ScanBench,
    state: ForecastState,
    folder: Path,
    runner: JobRunner | None = None,
    automatic: bool = False,
) -> ForecastController:
    """A controller that weighs the presets, the published plan and a comb."""
    return ForecastController(
        state,
        bench.state,
        bench.rig.state,
        bench.scans.plans,
        runner or InlineRunner(bench.notifier),
        bench.notifier,
        folder,
        automatic,
        lambda basis: (CapturePlan(name="published", sentinels=Sentinels()), COMB),
    )


def made_up_prediction(rig: Rig, plan: CapturePlan, latency_ms: float) -> Prediction:
    """A prediction that takes no time: errors fall with time and grow with noise."""
    from dsl_core.planning.expected import Prediction

    seconds = plan.duration_s(latency_ms)
    error = (1 + rig.sensor.read_noise_dn) / seconds
    return Prediction(
        frames=plan.shot_count, spectral_frames=plan.spectral_count, seconds=seconds,
        raw_bytes=plan.raw_bytes, computing_s=1.0, rmse=error / 3, pixel_rmse=error, angle_rad=error,
        pixel_angle_rad=3 * error, delta_e=100 * error, fwhm_nm=9 + error, depth_std_mm=error,
        coverage=0.9, decided=0.9,
    )  # fmt: skip
