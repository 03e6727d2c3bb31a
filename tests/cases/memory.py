"""Not waiting for the disk, which takes most of the time of small scans."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

MEMORY = Path("/dev/shm")
#: Less free memory than this is left to others, bytes.
LEAST_FREE = 1 << 30


@contextmanager
def folder_in_memory(otherwise: Path) -> Iterator[Path]:
    """A new folder in memory, or ``otherwise`` where there is none.

    A killed process loses nothing there that it gave to the system: only a power cut tells it from a disk.
    """
    if not (os.access(MEMORY, os.W_OK) and shutil.disk_usage(MEMORY).free > LEAST_FREE):
        yield otherwise
        return
    with tempfile.TemporaryDirectory(prefix="dsl-scan-test-", dir=MEMORY) as name:
        yield Path(name)


def do_not_wait_for_the_disk() -> None:
    """Let `os.fsync` do nothing in this process: no test pulls the plug.

    The tests that need it to be called or to fail put their own in its place.
    """
    os.fsync = _written


def _written(fd: object) -> None:
    """Take a file for written."""
