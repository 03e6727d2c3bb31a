"""Jobs: long work with its state and progress, and the interface of their runner. No Qt here."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass, field
from enum import Enum
from typing import Any, Generic, Protocol, TypeVar

from dsl_app.shared.jobs.clock import Course, JobClock, TimeLeft
from dsl_core.errors import Cancelled
from dsl_core.progress import CallbackProgress, CancelToken, Progress

T = TypeVar("T")
_log = logging.getLogger(__name__)
#: Parts in which the share of a job is counted.
SHARES = 1000
#: How long the stages of jobs took in this session, by kind.
_courses: dict[str, Course] = {}


class JobState(Enum):
    """State of a job; the last three are final."""

    WAITING = "waiting"
    RUNNING = "running"
    DONE = "done"
    FAILED = "failed"
    CANCELLED = "cancelled"

    @property
    def is_final(self) -> bool:
        """Whether nothing more will happen."""
        return self in (JobState.DONE, JobState.FAILED, JobState.CANCELLED)


@dataclass(frozen=True)
class JobProgress:
    """The latest report of a job; ``total`` 0 means that the end is not known, nor the time left."""

    stage: str = ""
    done: int = 0
    total: int = 0
    remaining_s: float | None = None


@dataclass
class Job(Generic[T]):
    """Long work and its outcome.

    ``work`` runs in a worker thread and reports to the `Progress` it is given; the callbacks run in the
    window's thread. ``exclusive`` names something that only one job may use at a time, such as the rig.
    ``time_left`` tells the time left where the work knows it better than its reports say, and ``share`` what
    part of it is done, 0 to 1, where reports are of a step.
    ``is_told_elsewhere`` leaves the job to the dialog that shows how far it is, and stops it.
    ``is_minor`` jobs are stopped without a question when the window closes. ``on_accepted`` is called when
    the runner has accepted the job, before the work begins; ``on_ended`` before the other callbacks, however
    the job ends. Without ``on_failed`` the runner tells the person what went wrong.
    """

    title: str
    work: Callable[[Progress], T]
    on_done: Callable[[T], object] | None = None
    on_failed: Callable[[Exception], object] | None = None
    on_cancelled: Callable[[], object] | None = None
    exclusive: str = ""
    is_minor: bool = False
    is_told_elsewhere: bool = False
    on_accepted: Callable[[], object] | None = None
    on_ended: Callable[[], object] | None = None
    state: JobState = JobState.WAITING
    progress: JobProgress = JobProgress()
    error: Exception | None = None
    time_left: Callable[[], float | None] | None = None
    share: Callable[[], float] | None = None
    token: CancelToken = field(default_factory=CancelToken)

    def __post_init__(self) -> None:
        # Jobs of a kind begin with the same word.
        self._clock = JobClock(self.title.split(" ")[0], _courses)

    def accept(self) -> None:
        """Call ``on_accepted``; called by the runner."""
        if self.on_accepted is not None:
            self.on_accepted()

    def cancel(self) -> None:
        """Ask the work to stop at its next report."""
        self.token.cancel()

    @property
    def extent(self) -> tuple[int, int]:
        """How much of how much is done, for a bar; the whole is 0 while it is not known."""
        if self.share is None:
            return self.progress.done, self.progress.total
        return int(SHARES * self.share()), SHARES

    @property
    def left(self) -> TimeLeft | None:
        """The time left; None while unknown."""
        if self.time_left is not None:
            seconds = self.time_left()
            return None if seconds is None else TimeLeft(seconds, True)
        return self._clock.left() if self.state is JobState.RUNNING else None

    def run(self) -> Callable[[], None]:
        """Do the work in this thread; the returned function finishes the job in the window's thread."""
        self.state = JobState.RUNNING
        try:
            if self.token.is_cancelled:
                raise Cancelled(f"{self.title} was stopped before it began.")
            result = self.work(CallbackProgress(self._report, self.token))
        except Cancelled:
            return self._finish_cancelled
        except Exception as error:  # shown in the window, never lost in a thread
            _log.warning("%s failed: %s", self.title, error, exc_info=error)
            failure = error
            return lambda: self._finish_failed(failure)
        return lambda: self._finish_done(result)

    def _report(self, stage: str, done: int, total: int) -> None:
        self._clock.report(stage, done, total)
        self.progress = JobProgress(stage, done, total)

    def _finish_done(self, result: T) -> None:
        self._clock.end()
        self._end(JobState.DONE)
        if self.on_done is not None:
            self.on_done(result)

    def _finish_failed(self, error: Exception) -> None:
        self.error = error
        self._end(JobState.FAILED)
        if self.on_failed is not None:
            self.on_failed(error)

    def _finish_cancelled(self) -> None:
        self._end(JobState.CANCELLED)
        if self.on_cancelled is not None:
            self.on_cancelled()

    def _end(self, state: JobState) -> None:
        self.state = state
        if self.on_ended is not None:
            self.on_ended()


class JobRunner(Protocol):
    """Runs jobs, keeps those that have not ended, and tells the errors that no job handles itself."""

    @property
    def active(self) -> tuple[Job[Any], ...]:
        """Jobs that wait or run."""

    def submit(self, job: Job[Any]) -> Job[Any]:
        """Start a job; raises `DeviceError` when another job uses the same exclusive resource."""
