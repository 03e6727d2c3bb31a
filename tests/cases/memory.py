"""Not waiting for the disk, which takes most of the time of small scans."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import psutil

MEMORY = Path("/dev/shm")
#: Tests keep less than this, bytes, and leave as much to others.
LEAST_FREE = 4 << 30


def keep_temporary_folders_in_memory() -> None:
    """Let pytest make its folders in memory, for programs that tests start, unless told of a place.

    A killed process loses nothing there that it gave to the system: only a power cut tells it from a disk.
    """
    if not os.access(MEMORY, os.W_OK) or shutil.disk_usage(MEMORY).free < LEAST_FREE:
        return
    if psutil.virtual_memory().available > 2 * LEAST_FREE:
        os.environ.setdefault("PYTEST_DEBUG_TEMPROOT", str(MEMORY))


def do_not_wait_for_the_disk() -> None:
    """Let `os.fsync` do nothing in this process: no test pulls the plug.

    The tests that need it to be called or to fail put their own in its place.
    """
    os.fsync = _written


def _written(fd: object) -> None:
    """Take a file for written."""
