"""The demo: finished scans of the simulated rig, and a live one. No Qt."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING

from dsl_app.connection.controller import RigController
from dsl_app.connection.state import Link, RigChoice
from dsl_app.shared.jobs.base import Job, JobRunner
from dsl_app.shared.notify import Notifier
from dsl_app.start.examples import EXAMPLES
from dsl_core.errors import StoreError

if TYPE_CHECKING:
    from dsl_app.scan.controller import ScanController

#: The live scan: a Color Checker, for less than half a minute.
LIVE_RIG = RigChoice("twin", (("scene", "color-checker"), ("size", "296x194")))
LIVE_PRESET = "preview"
#: What a finished scan offers, and how long it is said on the Results page, s.
PRESENTED = (
    "This is a finished scan of the simulated rig. Point at the picture to see a spectrum; click to pin it."
)
STAY_S = 30.0


class DemoController:
    """Opens finished scans, and starts a live one.

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

    # Finished scans --------------------------------------------------------------------------------

    def show(self, key: str = EXAMPLES[0].key) -> None:
        """Open a finished scan that comes with the program, from a folder where marks can be saved."""
        target = self._folder / f"{key}.zarr"
        title = f"Open the example {key}"
        self._runner.submit(Job(title, lambda progress: _fetch(key, target), self._present, self._failed))

    def _failed(self, error: Exception) -> None:
        self._notifier.tell("error", f"The example could not be opened: {error}")

    def _present(self, result: Path) -> None:
        self._open_result(result)
        self._notifier.offer(PRESENTED, {"Start a live scan": self.scan_live}, STAY_S)

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
        from dsl_app.scan.command_line import fresh_target
        from dsl_app.scan.state import Phase

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


def _fetch(key: str, target: Path) -> Path:
    """The example in a folder of the person's own, copied there unless it is; raises `StoreError`."""
    from dsl_core.io.result.result_file import RESULT_FOLDER, checked_attributes
    from dsl_core.io.staging import staged
    from dsl_core.resources import resource_path

    try:
        checked_attributes(target)
    except StoreError:
        # Not there yet, damaged, or of another version.
        with staged([target], overwrite=True, kind=RESULT_FOLDER) as (draft,):
            shutil.copytree(resource_path(f"examples/{key}.zarr"), draft)
    return target
