"""The connected rig, which every slice that measures shares: connect it, and let one job at a time use it.

No Qt.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import Any

from dsl_app.connection.state import Link, RigChoice, RigState
from dsl_app.shared.jobs.base import Job, JobRunner
from dsl_app.shared.notify import Notifier, sentence_of
from dsl_core.devices.base import DeviceRig, Projector
from dsl_core.errors import DeviceError, DriftError, DslError
from dsl_core.progress import Progress

_log = logging.getLogger(__name__)
#: What only one job may use at a time.
RIG = "the rig"
DISCONNECT, LIVE = "Disconnect", "Live view"


class RigController:
    """Connects a rig and lends it to jobs; a live view gives way to them, and so does what takes a moment.

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
        self._brief_job: Job[None] | None = None
        self._waiting: list[tuple[Job[Any], Callable[[str], object], Callable[[], object]]] = []

    # Connect ---------------------------------------------------------------------------------------

    def connect(self, choice: RigChoice) -> None:
        """Open a rig by name and close the current one; nothing changes while a job uses that."""
        self._open(choice, lambda devices: None, self._connected, self._refused, self._tell_refused)

    def reconnect(
        self, choice: RigChoice, done: Callable[[], object], failed: Callable[[str], object]
    ) -> None:
        """Open a lost rig again and check that it answers; else it stays lost, and ``failed`` is told why."""

        def connected(devices: DeviceRig) -> None:
            self._connected(devices)
            done()

        def still_lost(error: Exception) -> None:
            self.lose(str(error))
            failed(str(error))

        self._open(choice, require_answers, connected, still_lost, failed)

    def lose(self, reason: str) -> None:
        """Mark the rig as lost: a device no longer responds."""
        self.state.link.set(Link.LOST)
        self.state.trouble.set(reason)

    def lose_by(self, error: Exception) -> bool:
        """Mark the rig as lost if an error says that a device no longer responds; whether it does.

        A device whose pictures are wrong responds, and needs another remedy.
        """
        from dsl_core.capture.proven.wrong_pictures import PictureError

        is_lost = isinstance(error, DeviceError) and not isinstance(error, (DriftError, PictureError))
        if is_lost:
            self.lose(sentence_of(error))
        return is_lost

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
                old.close_quietly()
            devices = open_rig(choice.name, dict(choice.options))
            devices.projector = self._wrap(devices.projector)
            try:
                check(devices)
            except BaseException:
                devices.close_quietly()
                raise
            return devices

        def accepted() -> None:
            state.choice.set(choice)
            state.link.set(Link.OPENING)
            # What hindered the connection before is no longer true of this one.
            self._notifier.withdraw(state.trouble.value)
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

        if self._is_yielding:
            # No second request is accepted while the live view stops.
            state.link.set(Link.OPENING)
        title = f"Connect {choice.name}"
        job = Job(title, work, done, failed, cancelled, exclusive=RIG, is_minor=True)
        self.run(job, not_now, accepted)

    def disconnect(self) -> None:
        """Close the devices, unless a job uses them."""
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

    def _refused(self, error: Exception) -> None:
        self.state.link.set(Link.CLOSED)
        self.state.trouble.set(str(error))
        self._notifier.tell("error", str(error))

    # Use -------------------------------------------------------------------------------------------

    def run(
        self,
        job: Job[Any],
        refused: Callable[[str], object] | None = None,
        accepted: Callable[[], object] = lambda: None,
    ) -> bool:
        """Run a job that uses the rig, after what gives way has ended; False when another job uses it.

        ``refused`` (default: show a message) is told why, now or when the live view has stopped.
        ``accepted`` is called instead as soon as the rig is the job's.
        """
        refused = refused or self._tell_refused
        if self._is_yielding:
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

    def waits(self, job: Job[Any]) -> bool:
        """Whether a job waits until what gives way has ended."""
        return any(job is each for each, *_ in self._waiting)

    def gives_way(self, job: Job[Any]) -> bool:
        """Whether a job that uses the rig lets others have it soon."""
        return job is self._live_job or job is self._brief_job

    @property
    def _is_yielding(self) -> bool:
        return self._live_job is not None or self._brief_job is not None

    def _tell_refused(self, text: str) -> None:
        self._notifier.tell("warning", text)

    def do_briefly(self, title: str, work: Callable[[], None], failed: Callable[[Exception], object]) -> None:
        """Let ``work`` use the rig for a moment, not in the window's thread: a device may hang.

        Jobs that need the rig meanwhile wait for its end.
        """

        def ended() -> None:
            self._brief_job = None
            self._run_waiting()

        def ended_badly(error: Exception) -> None:
            failed(error)
            ended()

        job = Job(
            title,
            lambda _progress: work(),
            lambda _: ended(),
            ended_badly,
            ended,
            exclusive=RIG,
            is_minor=True,
            is_told_elsewhere=True,
        )

        def accepted() -> None:
            self._brief_job = job

        self.run(job, accepted=accepted)

    def start_live(self, look: Callable[[Progress], None]) -> None:
        """Let ``look`` use the rig until `stop_live`, or until a job needs the rig."""
        if self._live_job is not None or any(job.title == LIVE for job, *_ in self._waiting):
            return
        job = Job(
            LIVE,
            look,
            on_failed=self._live_failed,
            on_cancelled=self._live_ended,
            exclusive=RIG,
            is_minor=True,
        )

        def accepted() -> None:
            self._live_job = job
            self.state.live.set(True)

        self.run(job, accepted=accepted)

    def stop_live(self) -> None:
        """Stop the live view after the current frame."""
        if self._live_job is not None:
            self._live_job.cancel()

    def _live_ended(self) -> None:
        self._live_job = None
        self.state.live.set(False)
        self._run_waiting()

    def _run_waiting(self) -> None:
        waiting, self._waiting = self._waiting, []
        for job, refused, accepted in waiting:
            self.run(job, refused, accepted)

    def _live_failed(self, error: Exception) -> None:
        self.lose(str(error))
        self._notifier.tell("error", f"The live view stopped: {error}")
        self._live_ended()


def require_answers(devices: DeviceRig) -> None:
    """Show black and take a frame; raises `DeviceError` when a device was opened but does not answer."""
    import numpy as np

    info, camera = devices.projector.info, devices.camera
    devices.projector.show(np.zeros((info.height_px, info.width_px), np.uint8))
    camera.configure(camera.info.exposure_range_ms[0])
    camera.snap()
