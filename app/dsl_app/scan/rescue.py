"""Brings a rig back that was lost during a scan: a few attempts, each of them told. No Qt."""

from __future__ import annotations

import time
from collections.abc import Callable

from dsl_app.connection.controller import RigController
from dsl_app.connection.state import Link
from dsl_app.scan.state import Rescue, ScanState
from dsl_app.shared.notify import Notifier

#: How often a lost rig is connected again unasked, and how long after a failure, s.
ATTEMPTS, RETRY_S = 5, 3.0


class Rescuer:
    """Adds to the scan's ``trouble`` what becomes of the rig.

    ``resume`` goes on with the scan; it is called only where a person wished so.
    """

    def __init__(
        self,
        state: ScanState,
        rig: RigController,
        notifier: Notifier,
        resume: Callable[[], object],
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._state, self._rig, self._notifier = state, rig, notifier
        self._resume, self._clock = resume, clock
        self._story, self._choice = "", rig.state.choice.value
        self._attempt, self._next_s, self._resumes = 0, 0.0, False
        self._unfollow = rig.state.link.changed.connect(self._take_link)

    def begin(self, story: str) -> None:
        """Connect the rig again that a scan lost; ``story`` says how."""
        self._story, self._choice = story, self._rig.state.choice.value
        self._start(Rescue.TRYING)

    def try_now(self) -> None:
        """Connect it at once, and go on with the scan when it answers."""
        if self._state.rescue.value.is_trying:
            self._next_s = self._clock()
            self._tell_progress(Rescue.RESUMING)
            self.take_news()
        else:
            self._start(Rescue.RESUMING)

    def _start(self, rescue: Rescue) -> None:
        self._attempt, self._next_s = 0, self._clock()
        self._state.rescue.set(rescue)
        self.take_news()

    def take_news(self) -> None:
        """Make the next attempt when it is time; called by the window's clock."""
        rescue = self._state.rescue.value
        if not rescue.is_trying or self._rig.state.link.value is Link.OPENING:
            return
        if self._clock() >= self._next_s:
            self._attempt += 1
            self._tell_progress(rescue)
            self._rig.reconnect(self._choice, self._answered, self._failed)

    def _tell_progress(self, rescue: Rescue) -> None:
        then = " The scan goes on by itself when it answers." if rescue is Rescue.RESUMING else ""
        self._tell(rescue, f"Connecting the rig again, attempt {self._attempt} of {ATTEMPTS}.{then}")

    def _answered(self) -> None:
        if self._resumes:
            self._notifier.tell("info", "The rig is connected again. The scan goes on.")
            self._resume()

    def _failed(self, reason: str) -> None:
        if not self._state.rescue.value.is_trying:
            return
        self._next_s = self._clock() + RETRY_S
        if self._attempt >= ATTEMPTS:
            self._tell(Rescue.GIVEN_UP, f"The rig could not be connected again: {reason}")
            self._notifier.tell("error", "The rig could not be connected again. The Scan page says why.")

    def stop(self) -> None:
        """Make no further attempt."""
        if self._state.rescue.value.is_trying:
            self._tell(Rescue.GIVEN_UP, "The rig is no longer being connected.")

    def forget(self) -> None:
        """The scan that lost the rig is no longer at hand."""
        self._state.rescue.set(Rescue.NONE)

    def _take_link(self, link: Link) -> None:
        """A rig is there, whoever connected it; the scan goes on only with the one that it lost."""
        rescue = self._state.rescue.value
        if link is Link.OPEN and rescue.is_away:
            self._resumes = rescue is Rescue.RESUMING
            self._tell(Rescue.BACK, "The rig is connected again.")

    def _tell(self, rescue: Rescue, text: str) -> None:
        self._state.rescue.set(rescue)
        self._state.trouble.set(f"{self._story} {text}")

    def close(self) -> None:
        """Follow the rig no more."""
        self._unfollow()
