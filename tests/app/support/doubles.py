"""Runners and a notifier that stand in for those of the window."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from dsl_app.shared.jobs.base import Job
from dsl_app.shared.notify import Level, Notifier, sentence_of


def tell_unhandled(job: Job[Any], notifier: Notifier | None) -> None:
    """Tell the error of a job that does not handle it, as the window does for its runner."""
    if job.error is not None and job.on_failed is None and notifier is not None:
        notifier.tell("error", sentence_of(job.error))


class InlineRunner:
    """Runs every job at once in the caller's thread; errors that no job handles go to ``notifier``."""

    def __init__(self, notifier: Notifier | None = None) -> None:
        self.finished: list[Job[Any]] = []
        self.notifier = notifier

    @property
    def active(self) -> tuple[Job[Any], ...]:
        """Nothing is ever left running."""
        return ()

    def submit(self, job: Job[Any]) -> Job[Any]:
        """Run the job to its end."""
        job.accept()
        job.run()()
        tell_unhandled(job, self.notifier)
        self.finished.append(job)
        return job


class WaitingRunner(InlineRunner):
    """Runs jobs at once, but keeps those with a title that begins as one of ``held``."""

    def __init__(self, *held: str, notifier: Notifier | None = None) -> None:
        super().__init__(notifier)
        self._held = held
        self.waiting: list[Job[Any]] = []

    def submit(self, job: Job[Any]) -> Job[Any]:
        """Run the job, or keep it for `run`."""
        if job.title.startswith(self._held):
            self.waiting.append(job)
            return job
        return super().submit(job)

    def run(self, place: int = 0) -> None:
        """Run one of the jobs that wait."""
        job = self.waiting.pop(place)
        job.run()()
        tell_unhandled(job, self.notifier)


class ManualRunner:
    """Keeps jobs until it is told to run them, as threads end them some time."""

    def __init__(self) -> None:
        self.waiting: list[Job[Any]] = []

    @property
    def active(self) -> tuple[Job[Any], ...]:
        return tuple(self.waiting)

    def submit(self, job: Job[Any]) -> Job[Any]:
        self.waiting.append(job)
        return job

    def run_next(self) -> None:
        self.waiting.pop(0).run()()

    def run_all(self) -> None:
        while self.waiting:
            self.run_next()


class RecordingNotifier:
    """Keeps what it is told."""

    def __init__(self) -> None:
        self.told: list[tuple[Level, str]] = []
        self.offers: dict[str, Callable[[], object]] = {}
        self.withdrawn: list[str] = []

    def tell(self, level: Level, text: str, details: str = "") -> None:
        """Keep the sentence."""
        self.told.append((level, text))

    def offer(self, text: str, offers: Mapping[str, Callable[[], object]], stay_s: float = 0.0) -> None:
        """Keep the sentence and what it offers."""
        self.told.append(("info", text))
        self.offers.update(offers)

    def withdraw(self, text: str) -> None:
        """Keep what was taken back."""
        self.withdrawn.append(text)
