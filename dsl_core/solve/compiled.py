"""How loops over pixels are compiled: one place for the options of numba.

Compiled code is kept beside its module, or in the user's cache where that cannot be written to; where
nothing can, as in a container that only reads, it is made by every process. It is made again when that
module changes: functions that call each other belong in one module, or an edit would not be noticed.
Products and sums may be fused, which rounds less; nothing else about the order of operations is given up, so
that NaN, infinity and zero behave as they do in numpy.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

from numba import njit

T = TypeVar("T")


_OPTIONS: dict[str, Any] = {
    "nogil": True,
    "error_model": "numpy",
    "fastmath": {"contract"},
    "no_cfunc_wrapper": True,
}
_NO_PYTHON: dict[str, Any] = {"no_cpython_wrapper": True}


def compiled(function: Callable[..., T]) -> Callable[..., T]:
    """A function of arrays and numbers as machine code, which runs without Python's lock on one thread."""
    return _kept(function)


def _kept(function: Callable[..., T], signature: str | None = None) -> Callable[..., T]:
    """Compiled for a signature, if there is one, and kept on the disk where that is possible."""
    made: Callable[..., T]
    try:
        made = njit(signature, cache=True, **_OPTIONS)(function)
    except RuntimeError as error:
        if "no locator" not in str(error):
            raise
        made = njit(signature, **_OPTIONS)(function)
    return made


def compiled_for(signature: str) -> Callable[[Callable[..., T]], Callable[..., T]]:
    """As `compiled`, for arguments of these types alone, and when its module is imported.

    Otherwise a loop is compiled for arrays whose parts lie side by side, and again for those of larger ones.
    """

    def of(function: Callable[..., T]) -> Callable[..., T]:
        return _kept(function, signature)

    return of


def within(function: Callable[..., T]) -> Callable[..., T]:
    """A part of compiled functions of the same module: kept with them, and not to be called by others."""
    made: Callable[..., T] = njit(**_OPTIONS, **_NO_PYTHON)(function)
    return made
