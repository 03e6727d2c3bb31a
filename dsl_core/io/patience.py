"""Drives that do not answer for a while: a network share that vanishes, a disk that wakes up.

What a scan has captured cannot be captured again just like that, so its frames are written and read with
patience. A file that is missing, refused or damaged is none of a drive's silence, and is told at once. One
that is refused is not lost: it may be as whole as it was.
"""

from __future__ import annotations

import errno
import logging
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from dsl_core.errors import DriveError

_logger = logging.getLogger(__name__)
T = TypeVar("T")
#: What systems say of a drive that is away, by its numbers on POSIX; some do not exist everywhere.
_AWAY = {
    getattr(errno, name)
    for name in (
        *("EIO", "ESTALE", "ENODEV", "ENXIO", "ENOTCONN", "ECONNRESET", "ECONNABORTED", "ETIMEDOUT"),
        *("EHOSTDOWN", "EHOSTUNREACH", "ENETDOWN", "ENETUNREACH", "ENETRESET"),
    )
    if hasattr(errno, name)
}
#: The same on Windows: not ready, path or name of the network gone, no answer in time, I/O error, cut off.
_AWAY_WINDOWS = {21, 53, 59, 64, 121, 1117, 1167, 1231}
#: What systems say of a file that is there and cannot be opened now: it is closed to this user or, as Windows
#: says it, in use by another program; the computer has no more open files or memory to give.
_CLOSED = {errno.EACCES, errno.EPERM}
_SHORT = {errno.EMFILE, errno.ENFILE, errno.ENOMEM}


@dataclass(frozen=True)
class Patience:
    """For how long and how often a drive is asked, s; ``clock`` and ``sleep`` are those of the computer."""

    most_s: float = 60.0
    every_s: float = 1.0
    clock: Callable[[], float] = time.monotonic
    sleep: Callable[[float], None] = time.sleep


#: What to do about a drive that is away.
CHECK_DRIVE = "Its drive does not answer; what is saved there is kept. Check its connection, and try again."
#: That of every scan.
USUAL = Patience()


def is_refused(error: BaseException | None) -> bool:
    """Whether a file, which may be whole, could not be opened as things are now."""
    return isinstance(error, OSError) and error.errno in _CLOSED | _SHORT


def says_nothing(error: BaseException | None) -> bool:
    """Whether a failure tells nothing of the file that was to be read: it may be as whole as it was."""
    return is_away(error) or is_refused(error)


def is_away(error: BaseException | None) -> bool:
    """Whether an error, or what it comes from, is that of a drive that does not answer."""
    while error is not None:
        if isinstance(error, OSError):
            return error.errno in _AWAY or getattr(error, "winerror", None) in _AWAY_WINDOWS
        error = error.__cause__
    return False


def patiently(
    action: Callable[[], T],
    path: Path,
    is_gone: Callable[[], bool] = lambda: True,
    patience: Patience | None = None,
) -> T:
    """What ``action`` returns, asked again while the drive of ``path`` does not answer.

    ``is_gone`` tells a drive from a bad place on it: that fails for ever, and is not waited for. Raises what
    ``action`` raises last.
    """
    patience = patience or USUAL
    until_s: float | None = None
    while True:
        try:
            done = action()
        except Exception as error:
            if not is_away(error) or not is_gone():
                raise
            if until_s is None:
                until_s = patience.clock() + patience.most_s
                _logger.warning(
                    "The drive of %s does not answer. Waiting for it for up to %.0f s.", path, patience.most_s
                )
            elif patience.clock() >= until_s:
                raise
            patience.sleep(patience.every_s)
            continue
        if until_s is not None:
            _logger.warning("The drive of %s answers again.", path)
        return done


def advice_on(error: OSError, otherwise: str) -> str:
    """What to do about a file that cannot be read; ``otherwise`` where the file itself is at fault."""
    if error.errno in _CLOSED:
        return (
            "It may be whole, but this user or program may not read it. Change its permissions, or close the"
            " program that uses it, and try again."
        )
    if error.errno in _SHORT:
        return "It may be whole, but this computer can open no more. Close other programs, and try again."
    return CHECK_DRIVE if is_away(error) else otherwise


def drive_error(path: Path, error: OSError) -> DriveError:
    """The sentence for a drive that does not answer, or a file that is refused."""
    return DriveError(
        f"{path} cannot be read or written ({error.strerror or error}). {advice_on(error, CHECK_DRIVE)}"
    )
