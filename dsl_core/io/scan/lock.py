"""One writer a scan: a lock of the operating system, which dies with its process."""

from __future__ import annotations

import contextlib
import errno
import os
import sys
from pathlib import Path

from dsl_core.errors import StoreError
from dsl_core.io.atomic import store_error, write_all

#: Windows locks byte ranges for reading too, so the locked byte is behind the text.
_LOCK_BYTE = 1 << 20
#: What systems say of a lock that another process holds; anything else is the drive's own failure.
_HELD = {errno.EAGAIN, errno.EWOULDBLOCK, errno.EACCES, errno.EDEADLK}


class LockedError(StoreError):
    """Another process holds the lock."""


class FolderLock:
    """Held from construction to `release`; a lock left by a killed process is free at once."""

    def __init__(self, path: Path) -> None:
        """Take the lock; raises `LockedError` that names who holds it, `StoreError` where none can be had."""
        try:
            self._descriptor: int | None = os.open(path, os.O_RDWR | os.O_CREAT, 0o644)
        except OSError as error:
            raise store_error(path, error) from error
        try:
            _lock(self._descriptor)
        except OSError as error:
            owner = os.read(self._descriptor, 32).decode(errors="replace").strip() or "unknown"
            os.close(self._descriptor)
            self._descriptor = None
            if error.errno not in _HELD:
                raise StoreError(
                    f"{path.parent} cannot be locked ({error.strerror or error}), so that two programs might"
                    " write to it at once. Choose a folder on a drive of this computer, or have the network"
                    " drive mounted with locks."
                ) from error
            raise LockedError(
                f"{path.parent} is being written by another process (number {owner})."
                " Wait until it ends, or end it, and try again."
            ) from error
        with contextlib.suppress(OSError):  # the number is a courtesy; a full disk must not cost the lock
            os.ftruncate(self._descriptor, 0)
            write_all(self._descriptor, f"{os.getpid()}\n".encode())

    def is_of(self, path: Path) -> bool:
        """Whether the file of that name is still the one that is locked, and no other of its name."""
        try:
            return self._descriptor is not None and os.path.samestat(
                os.fstat(self._descriptor), os.stat(path)
            )
        except OSError:
            return False

    def release(self) -> None:
        """Give the lock back; a second call does nothing."""
        if self._descriptor is not None:
            os.close(self._descriptor)
            self._descriptor = None


if sys.platform == "win32":

    def _lock(descriptor: int) -> None:
        import msvcrt

        os.lseek(descriptor, _LOCK_BYTE, os.SEEK_SET)
        try:
            msvcrt.locking(descriptor, msvcrt.LK_NBLCK, 1)
        finally:
            os.lseek(descriptor, 0, os.SEEK_SET)

else:

    def _lock(descriptor: int) -> None:
        import fcntl

        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
