"""Jobs that run when a test lets them, as threads end them some time."""

from __future__ import annotations

from typing import Any

from dsl_app.shared.jobs.base import Job


class Later:
    """A runner that keeps jobs until it is told to run them."""

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
