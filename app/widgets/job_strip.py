"""What runs now, in the status bar: stage, progress, time left, cancel."""

from __future__ import annotations

from PySide6.QtWidgets import QHBoxLayout, QLabel, QProgressBar, QPushButton, QWidget

from app.jobs.qt_runner import QtRunner
from dsl_core.progress import CancelToken


class JobStrip(QWidget):
    """Shows the oldest active job; hidden while nothing runs."""

    def __init__(self, runner: QtRunner, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._runner = runner
        self._token: CancelToken | None = None
        self._text = QLabel()
        self._text.setAccessibleName("Running job")
        self._bar = QProgressBar()
        self._bar.setFixedWidth(180)
        self._bar.setAccessibleName("Progress of the running job")
        self._cancel = QPushButton("Cancel")
        self._cancel.setToolTip("Stop this work at the next safe point; what is finished is kept")
        self._cancel.clicked.connect(self._stop)
        row = QHBoxLayout(self)
        row.setContentsMargins(0, 0, 4, 0)
        for widget in (self._text, self._bar, self._cancel):
            row.addWidget(widget)
        runner.changed.connect(self._show)
        self._show()

    def _stop(self) -> None:
        if self._token is not None:
            self._token.cancel()
            self._show()

    def _show(self) -> None:
        jobs = self._runner.active
        self.setVisible(bool(jobs))
        if not jobs:
            return
        job, progress = jobs[0], jobs[0].progress
        self._token = job.token
        parts = [job.title]
        if job.token.is_cancelled:
            parts.append("stopping")
        elif progress.stage:
            parts.append(progress.stage)
        left = job.remaining_s
        if left is not None and left >= 2 and not job.token.is_cancelled:
            parts.append(f"{describe_seconds(left)} left")
        if len(jobs) > 1:
            parts.append(f"and {len(jobs) - 1} more")
        self._text.setText(" · ".join(parts))
        self._bar.setRange(0, progress.total)
        self._bar.setValue(progress.done)
        self._cancel.setEnabled(not job.token.is_cancelled)


def describe_seconds(seconds: float) -> str:
    """A duration as people say it: ``45 s``, ``3 min``, ``1 h 20 min``."""
    if seconds < 90:
        return f"{seconds:.0f} s"
    minutes = round(seconds / 60)
    return f"{minutes} min" if minutes < 90 else f"{minutes // 60} h {minutes % 60} min"
