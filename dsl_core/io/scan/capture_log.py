"""The capture log: one line of JSON for every frame that is safely on disk.

Lines are only ever appended. A line cut off by a crash is the last one and is dropped; of two lines
for one shot the later one counts.
"""

from __future__ import annotations

import contextlib
import os
from pathlib import Path

from pydantic import Field

from dsl_core.errors import StoreError
from dsl_core.io.atomic import store_error, sync_folder, write_all, write_atomic
from dsl_core.io.patience import drive_error, is_away, patiently, says_nothing
from dsl_core.io.reading import read_bounded
from dsl_core.io.sealed import seal, unseal
from dsl_core.model.base import Record


class LogEntry(Record):
    """How a saved frame was captured.

    ``run`` counts how often the scan was opened for writing: frame numbers and clocks of a camera
    start again with it. ``attempts`` above one means that the frame was taken again before it was kept,
    and ``corrected`` why, where an earlier picture did not show the pattern. ``shown_s`` is the time of day
    at which the pattern was visible, s; 0 in scans of earlier versions. ``scan`` is when the scan began that
    the frame belongs to, as its manifest says; empty in scans of earlier versions.
    """

    shot: int = Field(ge=0)
    exposure_ms: float
    timestamp_s: float
    frame_id: int
    crc32: int
    attempts: int = 1
    corrected: str = ""
    shown_s: float = 0.0
    run: int = 0
    darkest_dn: int = 0
    brightest_dn: int = 65535
    scan: str = ""


def read_log(path: Path) -> tuple[list[LogEntry], int]:
    """All whole lines of a log, and how many bytes of the file they fill; raises `StoreError`."""
    try:
        data = read_bounded(path)
    except FileNotFoundError:
        return [], 0
    except OSError as error:
        if says_nothing(error):
            raise drive_error(path, error) from error
        raise StoreError(
            f"{path} cannot be read ({error.strerror or error}). Restore it from a copy of the scan."
        ) from error
    entries: list[LogEntry] = []
    good = 0
    lines = data.split(b"\n")
    for number, line in enumerate(lines[:-1], start=1):
        try:
            entries.append(LogEntry.model_validate_json(unseal(line)))
        except ValueError as error:
            if number == len(lines) - 1:
                break
            raise StoreError(
                f"Line {number} of {path} is damaged. Restore the file from a copy, or delete that line"
                " and resume: its frame is then captured again."
            ) from error
        good += len(line) + 1
    return entries, good


def _line(entry: LogEntry) -> bytes:
    return seal(entry.model_dump_json())


class CaptureLog:
    """A log open for appending."""

    def __init__(self, path: Path) -> None:
        """Open or create the log and cut off what a crash left of a last line; raises `StoreError`."""
        self.path = path
        self.entries, self._size = read_log(path)
        self._descriptor: int | None = None
        self._open()

    def _open(self) -> None:
        flags = os.O_WRONLY | os.O_CREAT | getattr(os, "O_BINARY", 0)
        try:
            self._descriptor = os.open(self.path, flags, 0o644)
            os.ftruncate(self._descriptor, self._size)
            # A new file is only there after a power cut once its folder is.
            sync_folder(self.path.parent)
        except OSError as error:
            raise store_error(self.path, error) from error

    def append(self, entry: LogEntry) -> None:
        """Add a line and wait until it is on disk; a line that does not fit is taken back.

        Raises `StoreError` where the log is closed or the disk fails.
        """
        if self._descriptor is None:
            raise StoreError(f"{self.path} is closed; open the scan again before writing to it.")
        line = _line(entry)
        patiently(lambda: self._append(line), self.path)
        self._size += len(line)
        self.entries.append(entry)

    def _append(self, line: bytes) -> None:
        descriptor = self._descriptor
        if descriptor is None:  # `append` has found it open
            return
        try:
            os.lseek(descriptor, self._size, os.SEEK_SET)
            write_all(descriptor, line)
            os.fsync(descriptor)
        except OSError as error:
            with contextlib.suppress(OSError):  # a torn line is dropped by the next reader anyway
                os.ftruncate(descriptor, self._size)
            if is_away(error):
                self._open_again(descriptor)
            raise store_error(self.path, error) from error

    def _open_again(self, old: int) -> None:
        """Take the file of that name, if it is the same one: a share that was away forgets what was open."""
        with contextlib.suppress(OSError):
            new = os.open(self.path, os.O_WRONLY | getattr(os, "O_BINARY", 0))
            if os.fstat(new).st_size < self._size:
                os.close(new)
                return
            self._descriptor = new
            os.close(old)

    def restore(self) -> bool:
        """Write all lines again unless the disk has them; says whether that was necessary."""
        if self._descriptor is not None and self._is_whole(self._descriptor):
            return False
        self.close()
        lines = b"".join(map(_line, self.entries))
        write_atomic(self.path, lines)
        self._size = len(lines)
        self._open()
        return True

    def _is_whole(self, descriptor: int) -> bool:
        """Whether the file of that name is the one being written, and holds every line."""
        try:
            same = os.path.samestat(os.stat(self.path), os.fstat(descriptor))
            return same and read_log(self.path)[0] == self.entries
        except (OSError, StoreError):
            return False

    def close(self) -> None:
        """Close the file; a second call does nothing."""
        if self._descriptor is not None:
            os.close(self._descriptor)
            self._descriptor = None
