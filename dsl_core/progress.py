"""How long-running work reports progress and is cancelled."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Protocol

from dsl_core.errors import Cancelled


class Progress(Protocol):
    """What a long computation reports while it runs."""

    def report(self, stage: str, done: int, total: int) -> None:
        """Tell that ``done`` of ``total`` steps of ``stage`` are finished; raises `Cancelled`.

        A total of 0 means that the end of the stage is not known.
        """


class NoProgress:
    """Reports nowhere and never cancels."""

    def report(self, stage: str, done: int, total: int) -> None:
        """Ignore the report."""


@dataclass
class CancelToken:
    """A flag that another thread sets to stop work at its next report."""

    _event: threading.Event = field(default_factory=threading.Event)

    def cancel(self) -> None:
        """Ask the work to stop."""
        self._event.set()

    @property
    def is_cancelled(self) -> bool:
        """Whether someone asked the work to stop."""
        return self._event.is_set()


@dataclass
class CallbackProgress:
    """Forwards reports to a function and stops the work when its token is cancelled."""

    callback: Callable[[str, int, int], None]
    token: CancelToken = field(default_factory=CancelToken)

    def report(self, stage: str, done: int, total: int) -> None:
        """Forward the report; raise `Cancelled` when the token says so."""
        if self.token.is_cancelled:
            raise Cancelled(f"Stopped during {stage!r} after {done} of {total} steps, as requested.")
        self.callback(stage, done, total)
