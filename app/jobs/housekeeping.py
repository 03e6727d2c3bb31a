"""Keeps memory small and objects of the window in its thread, while jobs allocate in theirs. No Qt here."""

from __future__ import annotations

import ctypes
import gc
import sys
from collections.abc import Callable
from functools import cache
from typing import Any

#: How often `collect` should be called, ms.
COLLECT_MS = 500
#: Heaps from which threads take memory. The system's default, eight a core, keeps what each of them once had.
HEAPS = 2
#: Numbers of the C library's ``mallopt``.
_M_ARENA_MAX = -8


def take_over_collection() -> None:
    """Let garbage be looked for only by `collect`.

    Python would look for it in whichever thread allocates most, and take apart there what belongs to the
    window: Qt ends programs for that.
    """
    gc.disable()


def give_back_collection() -> None:
    """Let Python look for garbage by itself again."""
    gc.enable()


def collect() -> None:
    """Look for garbage if there may be some; called in the window's thread."""
    counts, limits = gc.get_count(), gc.get_threshold()
    if counts[0] > limits[0]:
        oldest = max(i for i in range(3) if i == 0 or counts[i] > limits[i])
        gc.collect(oldest)


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
