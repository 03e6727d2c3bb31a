"""A runner whose jobs wait until a test lets them run, in any order."""

from __future__ import annotations

from typing import Any

from dsl_app.shared.jobs.base import InlineRunner, Job


class WaitingRunner(InlineRunner):
    """Runs jobs at once, but keeps those with a title that begins as one of ``held``."""

    def __init__(self, *held: str) -> None:
        super().__init__()
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
        self.waiting.pop(place).run()()
