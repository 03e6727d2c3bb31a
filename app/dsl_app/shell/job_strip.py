"""Active jobs in the status bar: stage, progress, time left, cancel."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QMenu, QSizePolicy, QWidget

from dsl_app.shared.jobs.base import Job
from dsl_app.shared.jobs.qt_runner import QtRunner
from dsl_app.shared.notify import describe_seconds
from dsl_app.shared.widgets.forms import label, named, progress_bar, push_button
from dsl_app.shared.widgets.layouts import STRETCH, row_of

#: The widest line of a job's words, px: longer ones take two, and leave room for a message.
WIDEST_PX = 320
#: Parts of fewer letters are not broken.
SHORT, NO_BREAK = 20, chr(0xA0)


class JobStrip(QWidget):
    """Shows one active job and cancels it or others; hidden while no job is active."""

    def __init__(self, runner: QtRunner, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._runner = runner
        self._shown: Job[Any] | None = None
        self._text = label("", name="Running job", wraps=True)
        self._text.setAlignment(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
        self._bar = progress_bar("Progress of the running job")
        self._bar.setFixedWidth(180)
        self._cancel = push_button("Cancel", "Stop this job at the next safe point; finished parts are kept")
        self._cancel.clicked.connect(self._stop_shown)
        self._choices = named(QMenu(self), "Job to cancel")
        self._choices.aboutToShow.connect(self._list_choices)
        self._cancel.setSizePolicy(QSizePolicy.Policy.Fixed, QSizePolicy.Policy.Fixed)
        row_of(STRETCH, self._text, self._bar, self._cancel, on=self, margins=(0, 0, 4, 0))
        runner.changed.connect(self._show)
        self._show()

    def _stop_shown(self) -> None:
        # If the button has a menu, the job is chosen there.
        if self._shown is not None and self._cancel.menu() is None:
            self._stop(self._shown)

    def _stop(self, job: Job[Any]) -> None:
        job.cancel()
        self._show()

    def _show(self) -> None:
        view = strip_view(self._runner.active)
        self.setVisible(view is not None)
        self._shown = None
        if view is None:
            return
        self._shown = view.job
        self._text.setText(_unbroken(view.text))
        self._text.setFixedWidth(min(self._text.fontMetrics().horizontalAdvance(view.text) + 4, WIDEST_PX))
        done, total = view.job.extent
        self._bar.setRange(0, total)
        self._bar.setValue(done)
        self._offer_choices(view.asks_which)
        self._cancel.setEnabled(view.can_cancel)

    # Which job to cancel ---------------------------------------------------------------------------

    def _offer_choices(self, several: bool) -> None:
        """Ask which job is meant if there are several; an open menu stays."""
        if self._choices.isVisible() or several == (self._cancel.menu() is not None):
            return
        self._cancel.setMenu(self._choices if several else None)  # type: ignore[arg-type]

    def _list_choices(self) -> None:
        self._choices.clear()
        for job in _major(self._runner.active):
            if job.is_told_elsewhere:
                continue
            action = self._choices.addAction(job.title.replace("&", "&&"))
            action.setEnabled(not job.token.is_cancelled)
            action.triggered.connect(lambda _checked=False, job=job: self._stop(job))


def _unbroken(text: str) -> str:
    """The same text, whose short parts stay on one line: a time says nothing without its unit."""
    parts = (part.replace(" ", NO_BREAK) if len(part) < SHORT else part for part in text.split(" · "))
    return " · ".join(parts)


@dataclass(frozen=True)
class StripView:
    """What the strip shows: a job, and whether Cancel works and asks which job is meant."""

    job: Job[Any]
    text: str
    asks_which: bool
    can_cancel: bool


def strip_view(jobs: Sequence[Job[Any]]) -> StripView | None:
    """The oldest job that a person waits for, else the oldest; None when none is active.

    Jobs that a dialog tells of are left out: two bars of one job are one too many.
    """
    jobs = [job for job in jobs if not job.is_told_elsewhere]
    if not jobs:
        return None
    major = _major(jobs)
    job = (major or jobs)[0]
    can_cancel = not all(each.token.is_cancelled for each in major or (job,))
    return StripView(job, " · ".join(_words_of(job, len(jobs) - 1)), len(major) > 1, can_cancel)


def _major(jobs: Sequence[Job[Any]]) -> list[Job[Any]]:
    """Jobs that a person started and waits for, the oldest first."""
    return [job for job in jobs if not job.is_minor]


def _words_of(job: Job[Any], others: int) -> list[str]:
    """What a job is doing, the time left, and how many other jobs are active."""
    parts = [job.title]
    if job.token.is_cancelled:
        parts.append("stopping")
    elif job.progress.stage.casefold() not in job.title.casefold():
        parts.append(job.progress.stage)
    left = job.left
    if left is not None and left.seconds >= 2 and not job.token.is_cancelled:
        of_what = "" if left.is_whole else " of this step"
        parts.append(f"{describe_seconds(left.seconds)} left{of_what}")
    if others:
        parts.append(f"and {others} more")
    return parts
