"""Reconnects a rig that was lost during a scan, in a limited number of attempts. No Qt."""

from __future__ import annotations

import time
from collections.abc import Callable

from dsl_app.connection.controller import RigController
from dsl_app.connection.state import Link
from dsl_app.scan.state import InterruptedScan, Reconnection, ScanState
from dsl_app.shared.notify import Notifier

#: Number of automatic attempts, and the wait after a failed one, s.
ATTEMPTS, RETRY_S = 5, 3.0


class Reconnector:
    """Appends the state of the reconnection to the scan's ``trouble``.

    ``resume`` resumes the scan; it is called only if the person asked for it.
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
        self._waits_for: InterruptedScan | None = None
        self._unfollow = rig.state.link.changed.connect(self._take_link)

    def open_rig_of(self, session: InterruptedScan) -> None:
        """Connect the rig that an interrupted scan was captured with, once, and resume the scan.

        While another rig is being connected it waits: a click is not forgotten.
        """
        assert session.rig is not None
        link = self._rig.state.link
        if link.value is Link.OPENING:
            if self._waits_for != session:
                self._waits_for = session
                link.changed.once(lambda _: self._go_on(), lambda now: now is not Link.OPENING)
            return

        def failed(reason: str) -> None:
            name = session.folder.name
            self._notifier.tell("error", f"The rig of {name} could not be connected: {reason}")

        def connected() -> None:
            if self._state.interrupted.value == session:
                self._resume()

        self._rig.reconnect(session.rig, connected, failed)

    def _go_on(self) -> None:
        """Resume the scan that waited, if it is still the one to resume."""
        session, self._waits_for = self._waits_for, None
        if session is not None and self._state.interrupted.value == session:
            self._resume()

    def begin(self, story: str) -> None:
        """Start to reconnect the rig that a scan lost; ``story`` says how it was lost."""
        self._story, self._choice = story, self._rig.state.choice.value
        self._start(Reconnection.TRYING)

    def try_now(self) -> None:
        """Reconnect at once, and resume the scan when the rig answers."""
        if self._state.reconnection.value.is_trying:
            self._next_s = self._clock()
            self._tell_progress(Reconnection.RESUMING)
            self.take_news()
        else:
            self._start(Reconnection.RESUMING)

    def _start(self, rescue: Reconnection) -> None:
        self._attempt, self._next_s = 0, self._clock()
        self._state.reconnection.set(rescue)
        self.take_news()

    def take_news(self) -> None:
        """Make the next attempt when it is due; called by a timer."""
        rescue = self._state.reconnection.value
        if not rescue.is_trying or self._rig.state.link.value is Link.OPENING:
            return
        if self._clock() >= self._next_s:
            self._attempt += 1
            self._tell_progress(rescue)
            self._rig.reconnect(self._choice, self._answered, self._failed)

    def _tell_progress(self, rescue: Reconnection) -> None:
        then = " The scan resumes automatically when it responds." if rescue is Reconnection.RESUMING else ""
        self._tell(rescue, f"Reconnecting the rig, attempt {self._attempt} of {ATTEMPTS}.{then}")

    def _answered(self) -> None:
        if self._resumes:
            self._notifier.tell("info", "The rig is reconnected. The scan resumes.")
            self._resume()

    def _failed(self, reason: str) -> None:
        if not self._state.reconnection.value.is_trying:
            return
        self._next_s = self._clock() + RETRY_S
        if self._attempt >= ATTEMPTS:
            self._tell(Reconnection.GIVEN_UP, f"The rig could not be reconnected: {reason}")

    def stop(self) -> None:
        """Make no further attempt."""
        if self._state.reconnection.value.is_trying:
            self._tell(Reconnection.GIVEN_UP, "Reconnecting was stopped.")

    def forget(self) -> None:
        """Forget the loss: another scan is current."""
        self._state.reconnection.set(Reconnection.NONE)

    def _take_link(self, link: Link) -> None:
        """Note that a rig is connected, whoever did it; only the lost rig resumes the scan."""
        rescue = self._state.reconnection.value
        if link is not Link.OPEN or not rescue.is_away:
            return
        self._resumes = rescue is Reconnection.RESUMING
        now = self._rig.state.choice.value
        is_back = now == self._choice
        self._tell(
            Reconnection.BACK,
            "The rig is reconnected." if is_back else f"Another rig is connected instead: {now.words}.",
        )

    def _tell(self, rescue: Reconnection, text: str) -> None:
        self._state.reconnection.set(rescue)
        self._state.trouble.set(f"{self._story} {text}")

    def close(self) -> None:
        """Disconnect from the rig's state."""
        self._unfollow()
