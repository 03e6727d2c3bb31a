"""Keeps memory small and objects of the window in its thread, while jobs allocate in theirs. No Qt here."""

from __future__ import annotations

import ctypes
import gc
import sys
import time
from collections.abc import Callable
from functools import cache
from typing import Any

#: How often a `Housekeeper` should look, ms, and how long all objects may go without a look at them, s.
LOOK_MS, ALL_S = 500, 300.0
#: Heaps from which threads take memory. The system's default, eight a core, keeps what each of them once had.
HEAPS = 2
#: Numbers of the C library's ``mallopt``.
_M_ARENA_MAX = -8


class Housekeeper:
    """Looks for garbage, in the thread that calls `look`, as long as it is in charge.

    Python by itself would look in whichever thread allocates most, and take apart there what belongs to the
    window: Qt ends programs for that. Nor would it look at what a job has left behind when that ends.
    """

    def __init__(self, is_busy: Callable[[], bool], clock: Callable[[], float] = time.monotonic) -> None:
        self._is_busy, self._clock = is_busy, clock
        self._was_busy = False
        self._last_all_s = clock()

    def take_charge(self) -> None:
        """Let garbage be looked for by this one alone."""
        gc.disable()

    def leave(self) -> None:
        """Let Python look for garbage by itself again."""
        gc.enable()

    def look(self) -> None:
        """At what is fresh while jobs run; at all that a job has left when it ends; seldom at everything."""
        is_busy = self._is_busy()
        has_ended, self._was_busy = self._was_busy and not is_busy, is_busy
        now_s = self._clock()
        if not is_busy and now_s - self._last_all_s > ALL_S:
            self._last_all_s = now_s
            gc.collect()
        elif has_ended:
            gc.collect(1)
        elif gc.get_count()[0] > gc.get_threshold()[0]:
            gc.collect(0)


def share_heaps() -> None:
    """Let all threads share few heaps; to be called before there are any."""
    limit = _c_function("mallopt")
    if limit is not None:
        limit(_M_ARENA_MAX, HEAPS)


def return_memory() -> None:
    """Give the system what was freed but is kept in heaps; quick where that is little."""
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
