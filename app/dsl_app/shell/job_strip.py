"""What runs now, in the status bar: stage, progress, time left, cancel."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from PySide6.QtWidgets import QHBoxLayout, QLabel, QMenu, QProgressBar, QPushButton, QWidget

from dsl_app.shared.jobs.base import Job
from dsl_app.shared.jobs.qt_runner import QtRunner
from dsl_app.shared.notify import describe_seconds


class JobStrip(QWidget):
    """Shows the oldest active job that somebody waits for, else the oldest; hidden while nothing runs."""

    def __init__(self, runner: QtRunner, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._runner = runner
        self._shown: Job[Any] | None = None
        self._text = QLabel()
        self._text.setAccessibleName("Running job")
        self._bar = QProgressBar()
        self._bar.setFixedWidth(180)
        self._bar.setAccessibleName("Progress of the running job")
        self._cancel = QPushButton("Cancel")
        self._cancel.setToolTip("Stop this work at the next safe point; what is finished is kept")
        self._cancel.clicked.connect(self._stop_shown)
        self._choices = QMenu(self)
        self._choices.setAccessibleName("Work to cancel")
        self._choices.aboutToShow.connect(self._list_choices)
        row = QHBoxLayout(self)
        row.setContentsMargins(0, 0, 4, 0)
        for widget in (self._text, self._bar, self._cancel):
            row.addWidget(widget)
        runner.changed.connect(self._show)
        self._show()

    def _stop_shown(self) -> None:
        # Where the button has a menu, that says which one is meant.
        if self._shown is not None and self._cancel.menu() is None:
            self._stop(self._shown)

    def _stop(self, job: Job[Any]) -> None:
        job.cancel()
        self._show()

    def _show(self) -> None:
        jobs = self._runner.active
        self.setVisible(bool(jobs))
        self._shown = None
        if not jobs:
            return
        matter = _that_matter(jobs)
        self._shown = job = (matter or jobs)[0]
        self._text.setText(" · ".join(_words_of(job, others=len(jobs) - 1)))
        self._bar.setRange(0, job.progress.total)
        self._bar.setValue(job.progress.done)
        self._offer_choices(len(matter) > 1)
        self._cancel.setEnabled(not all(each.token.is_cancelled for each in matter or (job,)))

    # Which job to cancel ---------------------------------------------------------------------------

    def _offer_choices(self, several: bool) -> None:
        """Ask which work is meant where it could be more than one; an open menu stays."""
        if self._choices.isVisible() or several == (self._cancel.menu() is not None):
            return
        self._cancel.setMenu(self._choices if several else None)  # type: ignore[arg-type]

    def _list_choices(self) -> None:
        self._choices.clear()
        for job in _that_matter(self._runner.active):
            action = self._choices.addAction(job.title.replace("&", "&&"))
            action.setEnabled(not job.token.is_cancelled)
            action.triggered.connect(lambda _checked=False, job=job: self._stop(job))


def _that_matter(jobs: Sequence[Job[Any]]) -> list[Job[Any]]:
    """Jobs that a person asked for and waits for, the oldest first."""
    return [job for job in jobs if not job.is_minor]


def _words_of(job: Job[Any], others: int) -> list[str]:
    """What a job is at, how long it takes yet, and how many run beside it."""
    parts = [job.title]
    if job.token.is_cancelled:
        parts.append("stopping")
    elif job.progress.stage:
        parts.append(job.progress.stage)
    left = job.remaining_s
    if left is not None and left >= 2 and not job.token.is_cancelled:
        parts.append(f"{describe_seconds(left)} left")
    if others:
        parts.append(f"and {others} more")
    return parts
