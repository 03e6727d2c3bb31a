"""What the Rig page decides: connect, look, expose, project. No Qt."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from dsl_app.connection.auto_exposure import AutoExposer, Region
from dsl_app.connection.state import FrameCounts, Link, RigChoice, RigState
from dsl_app.shared.jobs.base import Job, JobRunner
from dsl_app.shared.notify import Notifier
from dsl_core.devices.base import DeviceRig, Projector
from dsl_core.errors import DeviceError, DslError
from dsl_core.model.frames import Frame
from dsl_core.patterns.trial_pictures import PictureKind, trial_picture
from dsl_core.progress import Progress

_log = logging.getLogger(__name__)
#: What only one job may use at a time.
RIG = "the rig"
DISCONNECT = "Disconnect"
NO_CAMERA = "No camera is connected. Connect a rig first."
#: Lost frames in a row after which a camera counts as lost.
LOST_AFTER = 3
#: Shortest time between two live frames, s: a twin would else keep a core busy for nobody.
LIVE_PERIOD_S = 1 / 30


class RigController:
    """Connects a rig and shows what it sees.

    ``wrap_projector`` may put another projector before the rig's own, such as a real second screen.
    """

    def __init__(
        self,
        state: RigState,
        runner: JobRunner,
        notifier: Notifier,
        wrap_projector: Callable[[Projector], Projector] = lambda projector: projector,
    ) -> None:
        self.state, self._runner, self._notifier = state, runner, notifier
        self._wrap = wrap_projector
        self._live_job: Job[None] | None = None
        self._waiting: list[tuple[Job[Any], Callable[[str], object], Callable[[], object]]] = []
        self._mail: Frame | None = None
        self._lock = threading.Lock()
        self._counts = FrameCounts()
        self._exposer = AutoExposer(state, notifier, self.set_exposure)

    # Connect ---------------------------------------------------------------------------------------

    def connect(self, choice: RigChoice) -> None:
        """Open a rig by name, closing the one at hand; while something else uses that, all stays as it is."""
        self._open(choice, lambda devices: None, self._connected, self._refused, self._tell_refused)

    def reconnect(
        self, choice: RigChoice, done: Callable[[], object], failed: Callable[[str], object]
    ) -> None:
        """Open a lost rig again and see that it answers; else it stays lost, and ``failed`` is told why."""

        def connected(devices: DeviceRig) -> None:
            self._connected(devices)
            done()

        def still_lost(error: Exception) -> None:
            self.lose(str(error))
            failed(str(error))

        self._open(choice, require_answers, connected, still_lost, failed)

    def lose(self, reason: str) -> None:
        """Say that a device does not answer any more."""
        self.state.link.set(Link.LOST)
        self.state.trouble.set(reason)

    def _open(
        self,
        choice: RigChoice,
        check: Callable[[DeviceRig], object],
        done: Callable[[DeviceRig], object],
        failed: Callable[[Exception], object],
        refused: Callable[[str], object],
    ) -> None:
        state = self.state
        if state.link.value is Link.OPENING:
            return
        link, old = state.link.value, state.devices.value

        def work(progress: Progress) -> DeviceRig:
            from dsl_core.devices.registry import open_rig

            if old is not None:
                close_quietly(old)
            devices = open_rig(choice.name, dict(choice.options))
            devices.projector = self._wrap(devices.projector)
            try:
                check(devices)
            except BaseException:
                close_quietly(devices)
                raise
            return devices

        def accepted() -> None:
            state.choice.set(choice)
            state.link.set(Link.OPENING)
            state.trouble.set("")
            state.devices.set(None)

        def cancelled() -> None:
            # Only before it began: the devices are as they were.
            state.devices.set(old)
            not_now(f"{title} was cancelled before it began.")

        def not_now(text: str) -> None:
            if state.link.value is Link.OPENING:
                state.link.set(link)
            refused(text)

        if self._live_job is not None:
            # Nobody asks twice while the live view stops.
            state.link.set(Link.OPENING)
        title = f"Connect {choice.name}"
        job = Job(title, work, done, failed, cancelled, exclusive=RIG, is_minor=True)
        self.run(job, not_now, accepted)

    def disconnect(self) -> None:
        """Close the devices, unless something else uses them."""
        state = self.state
        link, old = state.link.value, state.devices.value
        if old is None or any(job.title == DISCONNECT for job, *_ in self._waiting):
            return

        def accepted() -> None:
            state.devices.set(None)
            state.link.set(Link.CLOSED)

        def cancelled() -> None:
            state.devices.set(old)
            state.link.set(link)

        work = lambda progress: old.close()  # noqa: E731
        job = Job(DISCONNECT, work, on_cancelled=cancelled, exclusive=RIG, is_minor=True)
        self.run(job, accepted=accepted)

    def _connected(self, devices: DeviceRig) -> None:
        self.state.devices.set(devices)
        self.state.link.set(Link.OPEN)
        low, high = devices.camera.info.exposure_range_ms
        self.state.exposure_ms.set(min(max(self.state.exposure_ms.value, low), high))

    def _refused(self, error: Exception) -> None:
        self.state.link.set(Link.CLOSED)
        self.state.trouble.set(str(error))
        self._notifier.tell("error", str(error))

    # Look ------------------------------------------------------------------------------------------

    def start_live(self) -> None:
        """Show frames as they come until `stop_live`."""
        devices = self.state.devices.value
        if devices is None:
            self._notifier.tell("info", NO_CAMERA)
            return
        if self._live_job is not None:
            return
        job = Job(
            "Live view",
            lambda progress: self._look(devices, progress),
            on_failed=self._live_failed,
            on_cancelled=self._live_ended,
            exclusive=RIG,
            is_minor=True,
        )
        try:
            self._runner.submit(job)
        except DeviceError as error:
            self._notifier.tell("warning", str(error))
            return
        self._live_job = job
        self._counts = FrameCounts()
        self.state.live.set(True)

    def stop_live(self) -> None:
        """Stop after the frame at hand."""
        if self._live_job is not None:
            self._live_job.cancel()

    def take_frame(self) -> None:
        """Hand the newest frame to who follows it; called by the window's clock."""
        with self._lock:
            frame, self._mail = self._mail, None
        if frame is not None:
            self.state.frame.set(frame)
            self.state.counts.set(self._counts)
            self._exposer.judge(frame)

    def _look(self, devices: DeviceRig, progress: Progress) -> None:
        lost = 0
        while True:
            progress.report("live", self._counts.shown, 0)
            start = time.monotonic()
            try:
                devices.camera.configure(self.state.exposure_ms.value)
                frame = devices.camera.snap()
            except DeviceError:
                lost += 1
                self._counts = replace(self._counts, lost=self._counts.lost + 1)
                if lost >= LOST_AFTER:
                    raise
                continue
            lost = 0
            self._post(frame)
            time.sleep(max(LIVE_PERIOD_S - (time.monotonic() - start), 0))

    def _post(self, frame: Frame) -> None:
        """Lay a frame ready for `take_frame`; one that nobody took meanwhile is skipped."""
        with self._lock:
            skipped = int(self._mail is not None)
            self._mail = frame
        counts = self._counts
        self._counts = replace(counts, shown=counts.shown + 1 - skipped, skipped=counts.skipped + skipped)

    def _live_ended(self) -> None:
        self._live_job = None
        self._exposer.end()
        self.state.live.set(False)
        waiting, self._waiting = self._waiting, []
        for job, refused, accepted in waiting:
            self.run(job, refused, accepted)

    def _live_failed(self, error: Exception) -> None:
        self.lose(str(error))
        self._notifier.tell("error", f"The live view stopped: {error}")
        self._live_ended()

    # Use -------------------------------------------------------------------------------------------

    def run(
        self,
        job: Job[Any],
        refused: Callable[[str], object] | None = None,
        accepted: Callable[[], object] = lambda: None,
    ) -> bool:
        """Run a job that uses the rig, after the live view has stopped; False when another one uses it.

        ``refused`` is told why, now or when the live view has stopped; else the person at the window is.
        ``accepted`` is called instead as soon as the rig is the job's.
        """
        refused = refused or self._tell_refused
        if self._live_job is not None:
            self._waiting.append((job, refused, accepted))
            self.stop_live()
            return True

        def taken() -> None:
            # Opening and closing devices takes no frames that a picture could spoil.
            self.state.used_by.set("" if job.is_minor else job.title)
            accepted()

        job.on_accepted, job.on_ended = taken, lambda: self.state.used_by.set("")
        try:
            self._runner.submit(job)
        except DslError as error:
            refused(str(error))
            return False
        return True

    def _tell_refused(self, text: str) -> None:
        self._notifier.tell("warning", text)

    def show(self, kind: PictureKind, level: float = 1.0, column_px: int = 0) -> None:
        """Project a trial picture, unless it would spoil frames; the live view goes on meanwhile."""
        if self.state.used_by.value:
            user = self.state.used_by.value
            self._notifier.tell("info", f"{user} has the projector. Wait for its end, or cancel it.")
            return
        devices = self.state.devices.value
        if devices is None:
            self._notifier.tell("info", "No projector is connected. Connect a rig first.")
            return
        info = devices.projector.info
        try:
            picture = trial_picture(kind, (info.width_px, info.height_px), level, column_px)
            devices.projector.show(picture)
        except DslError as error:
            self._notifier.tell("error", str(error))

    def expose_automatically(self, region_px: Region | None) -> None:
        """Find the exposure that suits a region of the picture, starting the live view where it is off."""
        if self.state.devices.value is None:
            self._notifier.tell("info", NO_CAMERA)
            return
        self.start_live()
        if self._live_job is not None:
            self._exposer.begin(region_px)

    def set_exposure(self, exposure_ms: float) -> None:
        """Expose live frames so long from now on, within what the camera can do."""
        camera = self.state.camera
        if camera is not None:
            low, high = camera.exposure_range_ms
            exposure_ms = min(max(exposure_ms, low), high)
        self.state.exposure_ms.set(exposure_ms)


def require_answers(devices: DeviceRig) -> None:
    """Show black and take a frame; raises `DeviceError` when a device was opened but is not there."""
    import numpy as np

    info, camera = devices.projector.info, devices.camera
    devices.projector.show(np.zeros((info.height_px, info.width_px), np.uint8))
    camera.configure(camera.info.exposure_range_ms[0])
    camera.snap()


def close_quietly(devices: DeviceRig) -> None:
    """Let devices go; lost ones may fail even in that, which must keep nobody from opening others."""
    try:
        devices.close()
    except Exception as error:
        _log.warning("the devices of %s did not close well: %s", devices.name, error)
