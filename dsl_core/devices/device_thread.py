"""Calls of drivers on a thread of their own, so that one that never returns holds up nothing but itself.

All calls come from one thread, because many drivers insist on that. Python cannot end a call that hangs: its
thread is left behind, and a new one serves the other devices, so that the projector can still be turned dark.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass, field
from queue import SimpleQueue
from typing import Any, TypeVar

T = TypeVar("T")
#: Patience is counted in steps of this, s: time during which the whole program stood still does not count.
STEP_S = 0.25


class HangingError(Exception):
    """A call did not return, this one or one before it; ``seconds`` is how long that was waited for."""

    def __init__(self, seconds: float) -> None:
        super().__init__(seconds)
        self.seconds = seconds


class DriverError(Exception):
    """A driver raised something; that is the cause of this error."""


@dataclass
class _Call:
    device: str
    action: Callable[[], Any]
    patience_s: float
    done: threading.Event = field(default_factory=threading.Event)
    waited_s: float = 0.0
    value: Any = None
    error: BaseException | None = None

    def run(self) -> None:
        try:
            self.value = self.action()
        except BaseException as error:  # even the end of the program is no affair of a driver
            self.error = error
        self.done.set()

    def wait(self) -> bool:
        """Wait as long as patience lasts; whether the call has returned."""
        while self.waited_s < self.patience_s:
            step_s = min(STEP_S, self.patience_s - self.waited_s)
            if self.done.wait(step_s):
                break
            self.waited_s += step_s
        return self.done.is_set()


class DeviceThread:
    """Runs calls one after the other; callers may be on any thread."""

    def __init__(self, name: str) -> None:
        """Start nothing yet; ``name`` is the thread's."""
        self._name = name
        self._lock = threading.Lock()
        self._worker: threading.Thread | None = None
        self._inbox: SimpleQueue[_Call | None] = SimpleQueue()
        self._latest: _Call | None = None
        self._hanging: dict[str, _Call] = {}

    def call(self, device: str, action: Callable[[], T], patience_s: float) -> T:
        """What ``action`` returns.

        Raises `HangingError` when it does not return for ``patience_s``, or while an earlier call of the
        same ``device`` still hangs, and `DriverError` for whatever it raises.
        """
        if threading.current_thread() is self._worker:
            return action()
        with self._lock:
            if self._latest is not None and not self._latest.wait():
                self._abandon(self._latest)  # a call that was interrupted here, and then hung
            hanging = self._hanging.get(device)
            if hanging is not None and not hanging.done.is_set():
                raise HangingError(hanging.waited_s)
            call = self._latest = _Call(device, action, patience_s)
            self._send(call)
            if not call.wait():
                self._abandon(call)
                raise HangingError(call.waited_s)
        if call.error is not None:
            raise DriverError from call.error
        return call.value  # type: ignore[no-any-return]

    def end(self) -> None:
        """Let the thread end after its last call; another call starts a new one."""
        with self._lock:
            self._inbox.put(None)
            self._worker, self._inbox = None, SimpleQueue()

    def _send(self, call: _Call) -> None:
        if self._worker is None:
            # Not waited for when the program ends: it may hang.
            self._worker = threading.Thread(
                target=_serve, args=(self._inbox,), name=f"devices of {self._name}", daemon=True
            )
            self._worker.start()
        self._inbox.put(call)

    def _abandon(self, call: _Call) -> None:
        """Leave the thread to the call that hangs; it ends if that ever returns."""
        self._hanging[call.device] = call
        self._inbox.put(None)
        self._worker, self._inbox, self._latest = None, SimpleQueue(), None


def _serve(inbox: SimpleQueue[_Call | None]) -> None:
    while (call := inbox.get()) is not None:
        call.run()
