"""Who works on a result: at most one of the processes of all computers that see its folder.

A claim is a file next to the result, ``.NAME.claim``, that is locked while its owner lives, and another that
says who that is, ``.NAME.owner.json``. A lock dies with its process. Some network drives keep those of
another computer apart, so that the owner also touches its file every few seconds: one of another computer
that has not been touched for long is of a process that is dead.
"""

from __future__ import annotations

import contextlib
import os
import platform
import threading
from pathlib import Path
from typing import Self

from dsl_core.errors import StoreError
from dsl_core.io.atomic import make_folder
from dsl_core.io.records import read_record, replace_record
from dsl_core.io.scan.lock import FolderLock, LockedError
from dsl_core.model.base import Record

#: The owner's file is touched this often, seconds, and not believed after so long.
BEAT_S, LAPSE_S = 15.0, 90.0


class ClaimedError(StoreError):
    """Another process works on the same result."""


class Owner(Record):
    """A process by its number and the name of its computer."""

    host: str
    process: int

    @classmethod
    def this(cls) -> Owner:
        """The process that asks."""
        return cls(host=platform.node(), process=os.getpid())

    def __str__(self) -> str:
        return f"process {self.process} on {self.host}"


class Claim:
    """Held from construction to `release`, or as a ``with`` block."""

    def __init__(self, target: Path, owner: Owner | None = None, beat_s: float = BEAT_S) -> None:
        """Claim a result; raises `ClaimedError` that names its owner, `StoreError` if the disk fails."""
        self._path = target.with_name(f".{target.name}.claim")
        self._owner_path = target.with_name(f".{target.name}.owner.json")
        make_folder(target.parent)
        self._lock = self._take(target)
        #: Whose claim was taken over, as a sentence; empty where there was none.
        self.taken_over = ""
        try:
            self._judge(target)
            replace_record(self._owner_path, owner or Owner.this())
        except BaseException:
            self._lock.release()
            raise
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._beat, args=(beat_s,), daemon=True, name="claim")
        self._thread.start()

    def _take(self, target: Path) -> FolderLock:
        while True:
            try:
                lock = FolderLock(self._path)
            except LockedError as error:
                if not self._path.is_file():
                    continue  # its owner has just released it
                raise self._claimed(target, self._owner()) from error
            if lock.is_of(self._path):
                return lock
            lock.release()

    def _judge(self, target: Path) -> None:
        """Take over what is of the dead; raises `ClaimedError` for what another computer works on."""
        before = self._owner()
        if before is None:
            return
        if before.host != platform.node() and self._age_s() < LAPSE_S:
            raise self._claimed(target, before)
        self.taken_over = f"{target} was begun by {before}, which died; it is continued where it was."

    def _age_s(self) -> float:
        """Seconds since the owner's file was touched, by the clock of the drive."""
        os.utime(self._path)
        return self._path.stat().st_mtime - self._owner_path.stat().st_mtime

    def _owner(self) -> Owner | None:
        if not self._owner_path.is_file():
            return None
        try:
            return read_record(self._owner_path, Owner)
        except StoreError:
            return None

    def _claimed(self, target: Path, owner: Owner | None) -> ClaimedError:
        return ClaimedError(
            f"{target} is being made by {owner or 'another process'}. Wait until it ends, or end it."
        )

    def _beat(self, beat_s: float) -> None:
        while not self._ended.wait(beat_s):
            with contextlib.suppress(OSError):
                os.utime(self._owner_path)

    def release(self) -> None:
        """Let others work on it."""
        self._ended.set()
        self._thread.join()
        for path in (self._owner_path, self._path):
            with contextlib.suppress(OSError):  # Windows keeps a file that is open
                path.unlink()
        self._lock.release()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *failure: object) -> None:
        self.release()
