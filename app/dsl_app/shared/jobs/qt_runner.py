"""Runs jobs in threads, with callbacks in the window's thread."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

from PySide6.QtCore import QObject, QTimer, Signal

from dsl_app.shared.jobs.base import Job, JobState
from dsl_app.shared.notify import sentence_of
from dsl_core.errors import DeviceError
from dsl_core.solve.heap import trim_memory

#: Interval between progress updates, ms: short enough to look smooth, long enough to cost little.
TICK_MS = 100
WORKERS = 3


class QtRunner(QObject):
    """A `JobRunner` whose callbacks run in the thread of the window.

    ``changed`` fires when a job starts or ends, and every `TICK_MS` while one runs; ``failed`` with what went
    wrong in a job that does not handle its failure.
    """

    changed = Signal()
    failed = Signal(str)
    _ended = Signal(object, object)

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._pool = ThreadPoolExecutor(WORKERS, thread_name_prefix="job")
        self._active: list[Job[Any]] = []
        self._is_over = False
        self._ended.connect(self._finish)
        self._ticker = QTimer(self)
        self._ticker.setInterval(TICK_MS)
        self._ticker.timeout.connect(self.changed)

    @property
    def active(self) -> tuple[Job[Any], ...]:
        """Jobs that wait or run."""
        return tuple(self._active)

    def submit(self, job: Job[Any]) -> Job[Any]:
        """Start a job; raises `DeviceError` when another job uses the same exclusive resource.

        After `shut_down` no job is started.
        """
        if self._is_over:
            job.state = JobState.CANCELLED
            return job
        for other in self._active:
            if job.exclusive and other.exclusive == job.exclusive:
                raise DeviceError(
                    f"{job.title} needs {job.exclusive}, which {other.title} is using. Wait until it ends, or"
                    " cancel it."
                )
        self._active.append(job)
        job.accept()
        self._pool.submit(self._work, job)
        self._ticker.start()
        self.changed.emit()
        return job

    def cancel_all(self) -> None:
        """Ask every job to stop."""
        for job in self._active:
            job.cancel()

    def shut_down(self) -> None:
        """Stop all jobs and wait for their threads; their callbacks are not called."""
        self._is_over = True
        self.cancel_all()
        self._ticker.stop()
        self._pool.shutdown(wait=True, cancel_futures=True)

    def _work(self, job: Job[Any]) -> None:
        finish = job.run()
        trim_memory()
        self._ended.emit(job, finish)

    def _finish(self, job: Job[Any], finish: Callable[[], None]) -> None:
        self._active.remove(job)
        if not self._active:
            self._ticker.stop()
        finish()
        if job.error is not None and job.on_failed is None:
            self.failed.emit(sentence_of(job.error))
        self.changed.emit()
