"""How loops over pixels are compiled: one place for the options of numba.

Compiled code is kept beside its module, or in the user's cache where that cannot be written to. The key is
the module's own file: functions that call each other belong in one module, or an edit would not be noticed.
Products and sums may be fused, which rounds less; nothing else about the order of operations is given up, so
NaN, infinity and zero behave as they do in numpy.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import ParamSpec, TypeVar

from numba import njit

P = ParamSpec("P")
T = TypeVar("T")


def compiled(function: Callable[P, T]) -> Callable[P, T]:
    """A function of arrays and numbers as machine code, which runs without Python's lock on one thread."""
    made: Callable[P, T] = njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})(function)
    return made
