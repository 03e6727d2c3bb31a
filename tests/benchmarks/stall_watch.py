"""How long the window's thread does not come round, by a timer of 10 ms.

A busy machine makes every timer late. So each gap is also given as it would be with a core to itself: what
the thread computed, and what the other threads of the program computed while it waited for them.
"""

from __future__ import annotations

import faulthandler
import os
import re
import tempfile
import threading
import time
from collections import deque
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import IO

from PySide6.QtCore import QTimer

PERIOD_MS = 10
#: Gaps (ms, on a quiet machine) above which, if asked for, it is written down what all threads did.
TELL_MS = 60


@dataclass
class Stalls:
    """Gaps between ticks (ms) by the clock, the same on a quiet machine, and the thread's own computing."""

    clock: list[float] = field(default_factory=list)
    quiet: list[float] = field(default_factory=list)
    own: list[float] = field(default_factory=list)


class StallWatch:
    """Counts gaps while `during` surrounds what happens; ``trace`` gets what threads did in long ones."""

    def __init__(self, trace: IO[str] | None = None) -> None:
        self._trace = trace
        self._samples = None if trace is None else Samples()
        self._stalls: Stalls | None = None
        self._timer = QTimer()
        self._timer.setInterval(PERIOD_MS)
        self._timer.timeout.connect(self._tick)
        self._before = _now()

    @contextmanager
    def during(self, name: str) -> Iterator[Stalls]:
        """Watch a block in which the event loop runs."""
        if self._trace is not None:
            self._trace.write(f"\n===== {name}\n")
        stalls = Stalls()
        self._stalls, self._before = stalls, _now()
        self._timer.start()
        try:
            yield stalls
        finally:
            self._timer.stop()
            self._tick()
            self._stalls = None

    def _tick(self) -> None:
        assert self._stalls is not None
        now = _now()
        clock, own, others, delay = (1000 * (new - old) for new, old in zip(now, self._before, strict=True))
        waited = max(clock - own - delay, 0.0)
        quiet = own + min(waited, max(others - own, PERIOD_MS))
        self._stalls.clock.append(clock)
        self._stalls.own.append(own)
        self._stalls.quiet.append(quiet)
        if self._trace is not None and self._samples is not None and quiet > TELL_MS:
            self._trace.write(f"\n----- {clock:.0f} ms, {quiet:.0f} quiet, {own:.0f} own\n")
            self._trace.write("\n".join(self._samples.between(self._before[0], now[0])) + "\n")
            self._trace.flush()
        self._before = now


class Samples:
    """What all threads did, looked at every few milliseconds by a thread that needs Python's lock as well.

    It reads what faulthandler writes: frames in hand would keep the variables of the window's thread alive,
    painters among them, or end them in this one.
    """

    PERIOD_S, DEPTH = 0.01, 9

    def __init__(self) -> None:
        self._kept: deque[tuple[float, str]] = deque(maxlen=3000)
        self._file = tempfile.TemporaryFile()  # noqa: SIM115 - open as long as the thread runs
        threading.Thread(target=self._look, name="samples", daemon=True).start()

    def between(self, start: float, end: float) -> list[str]:
        """What was seen from a time to another, and just after it: innermost frames first."""
        names = {thread.ident: thread.name for thread in threading.enumerate()}
        seen = [text for at, text in list(self._kept) if start <= at <= end + 2 * self.PERIOD_S]
        return [line for text in seen for line in ("", *self._threads(text, names))]

    def _look(self) -> None:
        while True:
            time.sleep(self.PERIOD_S)
            self._file.seek(0)
            self._file.truncate()
            faulthandler.dump_traceback(self._file)
            self._file.seek(0)
            self._kept.append((time.perf_counter(), self._file.read().decode()))

    def _threads(self, text: str, names: Mapping[int | None, str]) -> Iterator[str]:
        for part in re.split(r"^(?=Thread|Current thread)", text, flags=re.MULTILINE):
            ident = re.match(r".*(0x[0-9a-f]+)", part)
            name = names.get(int(ident[1], 16), "?") if ident else "samples"
            places = re.findall(r'File "(?:[^"]*/)?((?:[^"/]+/)?[^"/]+)", line (\d+) in (.*)', part)
            if name != "samples":
                yield f"  {name}: " + " < ".join(f"{f}:{n} {what}" for f, n, what in places[: self.DEPTH])


def _now() -> tuple[float, float, float, float]:
    """Seconds by the clock, computed by this thread, by the process, and spent ready without a core."""
    return time.perf_counter(), time.thread_time(), time.process_time(), _delay_s()


def _delay_s() -> float:
    """How long this thread has waited for a core; known on Linux alone."""
    try:
        read = os.open("/proc/thread-self/schedstat", os.O_RDONLY)
    except OSError:
        return 0.0
    try:
        return int(os.read(read, 100).split()[1]) / 1e9
    finally:
        os.close(read)
