"""The demo: a finished scan of the simulated rig, made once, and a live one. No Qt."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from datetime import datetime
from pathlib import Path

from dsl_app.connection.controller import RigController
from dsl_app.connection.state import Link, RigChoice
from dsl_app.scan.command_line import fresh_target
from dsl_app.scan.controller import ScanController
from dsl_app.scan.state import Phase
from dsl_app.shared.jobs.base import Job, JobRunner
from dsl_app.shared.notify import Notifier
from dsl_core.errors import Cancelled, DslError
from dsl_core.model.plan import CapturePlan
from dsl_core.model.presets import PRESETS
from dsl_core.progress import Progress

#: What the finished scan shows: large enough to look at and small enough to be made while a person waits.
SCENE = {"scene": "color-checker", "size": "296x194"}
PRESET = "quick"
#: The live scan: the same chart, for less than half a minute.
LIVE_RIG = RigChoice("twin", tuple(SCENE.items()))
LIVE_PRESET = "preview"
SCAN, RESULT = "demo.dsl", "demo.zarr"


class DemoController:
    """Opens the demo, making it where it is missing, and starts the live one.

    ``open_result`` shows a result; ``scan_page`` opens the Scan page and gives its controller.
    """

    def __init__(
        self,
        folder: Path,
        rig: RigController,
        runner: JobRunner,
        notifier: Notifier,
        open_result: Callable[[Path], object],
        scan_page: Callable[[], ScanController],
        clock: Callable[[], datetime] = datetime.now,
    ) -> None:
        self._folder, self._rig, self._runner, self._notifier = folder, rig, runner, notifier
        self._open_result, self._scan_page, self._clock = open_result, scan_page, clock
        self._is_made = False

    # The finished scan -----------------------------------------------------------------------------

    def show(self) -> None:
        """Open the finished scan; while it is being made, say so."""
        if (self._folder / RESULT).exists():
            self._present(self._folder / RESULT)
        elif self._is_made:
            self._notifier.tell("info", "The demo is being made; it opens when it is ready.")
        else:
            self._is_made = True
            self._notifier.tell("info", "Making the demo for the first time. This takes about a minute.")
            self._runner.submit(
                Job("Make the demo", self._make, self._present, self._failed, on_ended=self._end)
            )

    def _make(self, progress: Progress) -> Path:
        from dsl_core.io.result.result_file import save_result
        from dsl_core.workflows.scans import reconstruct_scan

        session = self._folder / SCAN
        try:
            take_demo(session, progress)
        except Cancelled:
            raise
        except DslError:
            # A scan of another version, or a damaged one, cannot be resumed.
            shutil.rmtree(session, ignore_errors=True)
            take_demo(session, progress)
        target = self._folder / RESULT
        save_result(reconstruct_scan(session, progress=progress), target)
        return target

    def _failed(self, error: Exception) -> None:
        self._notifier.tell("error", f"The demo could not be made: {error}")

    def _end(self) -> None:
        self._is_made = False

    def _present(self, result: Path) -> None:
        self._open_result(result)
        self._notifier.offer(
            "This is a finished scan of the simulated rig. Point at a patch to see its spectrum; click"
            " to pin it.",
            {"Start a live scan": self.scan_live},
        )

    # The live one ----------------------------------------------------------------------------------

    def scan_live(self) -> None:
        """Start a short scan of the simulated rig; connects it if no rig is connected."""
        link = self._rig.state.link
        if link.value not in (Link.OPEN, Link.OPENING):
            self._rig.connect(LIVE_RIG)
        if link.value is Link.OPENING:
            # The request is dropped when the rig cannot be connected.
            link.changed.once(lambda _: self._start(), lambda now: now is not Link.OPENING)
        else:
            self._start()

    def _start(self) -> None:
        if self._rig.state.link.value is not Link.OPEN:
            return
        name = self._rig.state.choice.value.name
        if name != LIVE_RIG.name:
            self._notifier.tell(
                "info",
                f"The rig {name} is connected. Disconnect it on the Rig page to run the live demo on the"
                " simulated rig, or start your own scan on the Scan page.",
            )
            return
        scans = self._scan_page()
        if scans.state.phase.value.is_busy:
            self._notifier.tell("info", "A scan is already running.")
            return
        scans.plan_new_scan()
        scans.plans.choose_preset(LIVE_PRESET)
        scans.plans.set_target(fresh_target(self._folder, self._clock()))
        scans.state.then_reconstruct.set(True)
        scans.start()
        if scans.state.phase.value is Phase.PLANNING:
            # It was refused: the next scan belongs in the person's own folder again.
            scans.plan_new_scan()


def take_demo(session: Path, progress: Progress) -> None:
    """Capture the demo's scan on the twin, or resume it; raises `DslError`."""
    from dsl_core import pipeline
    from dsl_core.devices.registry import open_rig
    from dsl_core.io.scan.origin import rig_notes

    session.parent.mkdir(parents=True, exist_ok=True)
    progress.report("open the simulated rig", 0, 1)
    with open_rig("twin", SCENE) as rig:
        plan = pipeline.fit_plan(demo_plan(), rig)
        pipeline.scan(rig, plan, session, progress, rig_notes("twin", SCENE))


def demo_plan() -> CapturePlan:
    """The plan of the finished scan."""
    return next(preset.plan for preset in PRESETS if preset.key == PRESET)
