"""One job at a time for a wizard, and how it ended. No Qt."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TypeVar

from dsl_app.calibrate.wizard.presentation import stopped_text
from dsl_app.calibrate.wizard.state import Doing, WizardState
from dsl_app.connection.controller import RIG, RigController
from dsl_app.shared.jobs.base import Job, JobProgress, JobRunner
from dsl_app.shared.notify import sentence_of
from dsl_core.progress import Progress

T = TypeVar("T")


class WizardJobs:
    """Starts jobs, says in the state how they go, and closes the wizard after the last one."""

    def __init__(self, state: WizardState, rig: RigController, runner: JobRunner) -> None:
        self.state, self._rig, self._runner = state, rig, runner
        self._job: Job[object] | None = None
        self._queued: Callable[[], object] | None = None
        self._is_left = False

    @property
    def is_free(self) -> bool:
        """Whether nothing runs and the wizard is still open."""
        return self._job is None and not self._is_left

    def start(
        self,
        doing: Doing,
        title: str,
        work: Callable[[Progress], T],
        done: Callable[[T], object],
        failed: Callable[[Exception], object] | None = None,
    ) -> None:
        """Run work in a job; looks and captures have the rig to themselves."""
        state, on_failed = self.state, failed or self.fail
        on_rig = doing in (Doing.LOOKING, Doing.CAPTURING)
        state.trouble.set("")
        state.can_reconnect.set(False)
        state.progress.set(JobProgress())
        job: Job[object] = Job(
            f"{state.title}: {title}",
            work,
            lambda result: self._over(lambda: done(result)),  # type: ignore[arg-type]
            lambda error: self._over(lambda: on_failed(error)),
            lambda: self._over(self._stopped),
            exclusive=RIG if on_rig else "",
            is_told_elsewhere=True,
        )
        # Set before any listener hears of it: it might leave at once.
        self._job = job
        state.doing.set(doing)
        if on_rig:
            self._rig.run(job, lambda text: self._over(lambda: self._refused(text)))
        else:
            self._runner.submit(job)

    def after_look(self, then: Callable[[], object]) -> None:
        """Do something now, or when the current look or reading has ended; otherwise it is ignored."""
        if self.is_free:
            self.state.is_checking.set(False)
            then()
        elif self.state.doing.value in (Doing.LOOKING, Doing.READING, Doing.OPENING):
            self.state.is_checking.set(False)
            self._queued = then

    def forget_queued(self) -> None:
        """Do not do what waits for the end of the current job."""
        self._queued = None

    def take_news(self) -> None:
        """Update how far the current job is."""
        if self._job is not None:
            left = self._job.left
            seconds = None if left is None else left.seconds
            self.state.progress.set(replace(self._job.progress, remaining_s=seconds))

    def stop(self) -> None:
        """Stop what a person waits for at its next safe point."""
        self.state.is_automatic.set(False)
        if self._job is not None and self.state.doing.value.is_long:
            self.state.doing.set(Doing.STOPPING)
            self._job.cancel()

    def leave(self) -> None:
        """Stop what runs; the state's ``closed`` fires when it has ended."""
        if self._is_left:
            return
        self._is_left = True
        self.state.is_checking.set(False)
        self.state.is_automatic.set(False)
        if self._job is None:
            self.state.closed.emit(None)
        else:
            self.state.doing.set(Doing.STOPPING)
            self._job.cancel()

    def fail(self, error: Exception) -> None:
        """Say what went wrong; nothing continues by itself."""
        self._give_up()
        # Other pages use the same rig, and would still call it connected.
        is_lost = self._rig.lose_by(error)
        self.state.trouble.set(sentence_of(error))
        self.state.can_reconnect.set(is_lost)

    def _over(self, then: Callable[[], object]) -> None:
        self._job = None
        self.state.doing.set(Doing.IDLE)
        if self._is_left:
            self.state.closed.emit(None)
            return
        then()
        queued, self._queued = self._queued, None
        if queued is not None and self.is_free:
            queued()

    def _refused(self, text: str) -> None:
        self._give_up()
        self.state.trouble.set(text)

    def _give_up(self) -> None:
        self.forget_queued()
        self.state.is_checking.set(False)
        self.state.is_automatic.set(False)

    def _stopped(self) -> None:
        self._give_up()
        self.state.note.set(stopped_text(self.state))
