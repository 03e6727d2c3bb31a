"""Garbage collection in the window's thread only. No Qt here."""

from __future__ import annotations

import gc
import time
from collections.abc import Callable

#: How often to call `GarbageCollector.check`, ms, and the longest time between two full collections, s.
CHECK_MS, FULL_S = 500, 300.0


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
