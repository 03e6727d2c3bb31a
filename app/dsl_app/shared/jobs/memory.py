"""Garbage collection in the window's thread only, and memory returned to the system. No Qt here."""

from __future__ import annotations

import ctypes
import gc
import sys
import time
from collections.abc import Callable
from functools import cache
from typing import Any

#: How often to call `GarbageCollector.check`, ms, and the longest time between two full collections, s.
CHECK_MS, FULL_S = 500, 300.0
#: Heaps from which threads allocate. Each of the system's default, eight a core, keeps its peak.
HEAPS = 2
#: Numbers of the C library's ``mallopt``.
_M_ARENA_MAX = -8


class GarbageCollector:
    """Collects garbage in the thread that calls `check`, in place of Python's automatic collection.

    That runs in whichever thread allocates most and would delete widgets there: Qt aborts programs for that.
    Nor would it collect what a job has left behind when that ends.
    """

    def __init__(self, is_busy: Callable[[], bool], clock: Callable[[], float] = time.monotonic) -> None:
        self._is_busy, self._clock = is_busy, clock
        self._was_busy = False
        self._last_full_s = clock()

    def start(self) -> None:
        """Switch Python's automatic collection off."""
        gc.disable()

    def stop(self) -> None:
        """Switch Python's automatic collection on again."""
        gc.enable()

    def check(self) -> None:
        """Collect new objects while jobs run, what a job has left when it ends, and seldom everything."""
        is_busy = self._is_busy()
        has_ended, self._was_busy = self._was_busy and not is_busy, is_busy
        now_s = self._clock()
        if not is_busy and now_s - self._last_full_s > FULL_S:
            self._last_full_s = now_s
            gc.collect()
        elif has_ended:
            gc.collect(1)
        elif gc.get_count()[0] > gc.get_threshold()[0]:
            gc.collect(0)


def limit_heaps() -> None:
    """Let all threads share few heaps; to be called before there are any."""
    limit = _c_function("mallopt")
    if limit is not None:
        limit(_M_ARENA_MAX, HEAPS)


def trim_memory() -> None:
    """Return freed memory of the heaps to the system; quick where there is little."""
    trim = _c_function("malloc_trim")
    if trim is not None:
        trim(0)


@cache
def _c_function(name: str) -> Callable[..., Any] | None:
    """A function of GNU's C library; None on other systems, whose heaps behave."""
    if sys.platform != "linux":
        return None
    found: Callable[..., Any] | None = getattr(ctypes.CDLL(None), name, None)
    return found
