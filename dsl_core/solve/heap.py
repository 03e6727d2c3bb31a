"""How this process keeps the memory it has freed. On systems without GNU's C library nothing is changed."""

from __future__ import annotations

import ctypes
import sys
from collections.abc import Callable
from functools import cache
from typing import Any

_MIB = 1 << 20
#: Up to this size an array comes from the heap, whose pages are used again; so much may lie free at its end,
#: and it grows in such steps, bytes.
_FROM_HEAP, _FREE, _STEP = 64 * _MIB, 128 * _MIB, 16 * _MIB
#: Heaps from which threads allocate. Each of the system's default, eight a core, keeps its peak.
_HEAPS = 2
#: Numbers of the C library's ``mallopt`` (``malloc.h``).
_M_TRIM_THRESHOLD, _M_TOP_PAD, _M_MMAP_THRESHOLD, _M_ARENA_MAX = -1, -2, -3, -8


def keep_freed_memory() -> None:
    """Use the pages of freed arrays for new ones.

    By itself the library returns them to the system and asks for them again, and the system clears each:
    a tenth of the processor time of a reconstruction of half a megapixel, at the same peak.
    """
    _set(_M_MMAP_THRESHOLD, _FROM_HEAP)
    _set(_M_TRIM_THRESHOLD, _FREE)
    _set(_M_TOP_PAD, _STEP)


def limit_heaps() -> None:
    """Let all threads share few heaps; to be called before there are any."""
    _set(_M_ARENA_MAX, _HEAPS)


def trim_memory() -> None:
    """Return freed memory of the heaps to the system; quick where there is little."""
    trim = _c_function("malloc_trim")
    if trim is not None:
        trim(0)


def _set(number: int, value: int) -> None:
    function = _c_function("mallopt")
    if function is not None:
        function(number, value)


@cache
def _c_function(name: str) -> Callable[..., Any] | None:
    if sys.platform != "linux":
        return None
    found: Callable[..., Any] | None = getattr(ctypes.CDLL(None), name, None)
    return found
