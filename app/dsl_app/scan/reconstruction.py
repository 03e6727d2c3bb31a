"""The reconstruction that follows a scan: its time beforehand, its depth as soon as known, its end. No Qt."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from dsl_app.scan.reconstruction_time import Pace
from dsl_app.scan.state import ScanState
from dsl_app.shared.jobs.base import Job, JobRunner
from dsl_app.shared.notify import Notifier, sentence_of
from dsl_core.io.neighbours import result_beside
from dsl_core.model.plan import CapturePlan
from dsl_core.model.result_sink import Maps
from dsl_core.progress import Progress


class Reconstructor:
    """Reconstructs scans as jobs; `take_news` copies the depth that is known first to the state."""

    def __init__(self, state: ScanState, runner: JobRunner, notifier: Notifier, pace: Pace) -> None:
        """Keep the parts; the ``pace`` learns from each reconstruction."""
        self._state, self._runner, self._notifier, self._pace = state, runner, notifier, pace
        #: The scan that was started last: its depth is shown, not that of others that still run.
        self._latest: Path | None = None
        #: The depth of that one, from its thread; news until it is in the state.
        self._seen_depth: NDArray[np.float32] | None = None
        self._running = 0
        self._stop_expecting = state.plan.follow(self._expect)

    def take_news(self) -> None:
        """Copy what the job reported since the last call to the state."""
        seen, self._seen_depth = self._seen_depth, None
        if seen is not None:
            self._state.depth.set(seen)

    def start(self, session: Path) -> None:
        """Reconstruct a complete scan, save the result next to it and report it."""
        state, before = self._state, self._state.note.value
        # How long it takes was said before; from now on the job's own clock tells what is left.
        waiting = f"{before} Reconstructing; the depth is shown first.".strip()
        plan, since_s = state.plan.value, time.monotonic()

        def done(path: Path) -> None:
            finish(f"The result is saved in {path}.")
            self._pace.learn(plan, time.monotonic() - since_s)
            self._expect(state.plan.value)
            state.result.emit(path)

        def finish(note: str) -> None:
            self._finish(session)
            # Another scan may have set a note of its own meanwhile.
            if state.note.value == waiting:
                state.note.set(note)

        def ended(how: str) -> None:
            retry = "Press Reconstruct… to begin again; the frames are kept."
            finish(f"{before} The reconstruction {how}. {retry}".strip())

        def failed(error: Exception) -> None:
            ended("failed")
            self._notifier.tell("error", sentence_of(error))

        def cancelled() -> None:
            ended("was cancelled")

        def work(progress: Progress) -> Path:
            return self._reconstruct(session, progress)

        state.note.set(waiting)
        self._show_none(session)
        self._running += 1
        state.is_reconstructing.set(True)
        self._runner.submit(Job(f"Reconstruct {session.stem}", work, done, failed, cancelled))

    def _reconstruct(self, session: Path, progress: Progress) -> Path:
        from dsl_core.workflows.scans import reconstruct_to

        def see(maps: Maps) -> None:
            if session == self._latest:
                self._seen_depth = np.asarray(maps["depth_mm"], np.float32)

        return reconstruct_to(result_beside(session), session, progress=progress, seen_geometry=see)

    def _finish(self, session: Path) -> None:
        self._running -= 1
        self._state.is_reconstructing.set(self._running > 0)
        if session == self._latest:
            self._show_none(None)

    def _show_none(self, latest: Path | None) -> None:
        """Show no depth until the latest scan has one."""
        self._latest, self._seen_depth = latest, None
        self._state.depth.set(None)

    def _expect(self, plan: CapturePlan) -> None:
        self._state.reconstruction_s.set(self._pace.expected_s(plan))

    def close(self) -> None:
        """Disconnect from the state."""
        self._stop_expecting()
