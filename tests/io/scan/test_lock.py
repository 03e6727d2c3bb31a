from __future__ import annotations

import errno
import os
from pathlib import Path

import pytest

from dsl_core.errors import StoreError
from dsl_core.io.scan import lock as lock_module
from dsl_core.io.scan.lock import FolderLock, LockedError


def test_a_lock_that_cannot_be_written_says_why(tmp_path: Path) -> None:
    with pytest.raises(StoreError, match=r"gone/lock could not be written \(No such file or directory\)"):
        FolderLock(tmp_path / "gone" / "lock")


def test_a_drive_without_locks_is_not_taken_for_another_writer(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(descriptor: int) -> None:
        raise OSError(errno.ENOLCK, os.strerror(errno.ENOLCK))

    monkeypatch.setattr(lock_module, "_lock", refuse)
    with pytest.raises(
        StoreError, match=r"cannot be locked \(No locks available\).*drive of this computer"
    ) as told:
        FolderLock(tmp_path / "lock")
    assert not isinstance(told.value, LockedError)


def test_a_lock_can_be_released_twice_and_taken_again(tmp_path: Path) -> None:
    first = FolderLock(tmp_path / "lock")
    with pytest.raises(StoreError, match="is being written by another process"):
        FolderLock(tmp_path / "lock")
    first.release()
    first.release()
    FolderLock(tmp_path / "lock").release()


def test_a_lock_names_its_process_alone(tmp_path: Path) -> None:
    path = tmp_path / "lock"
    path.write_text("a number of a process that was killed long ago\n")
    lock = FolderLock(path)
    assert path.read_text() == f"{os.getpid()}\n"
    before = len(os.listdir("/proc/self/fd")) if Path("/proc/self/fd").is_dir() else 0
    with pytest.raises(StoreError, match=f"number {os.getpid()}"):
        FolderLock(path)
    if before:
        assert len(os.listdir("/proc/self/fd")) == before, "a lock in vain leaves no file open"
    lock.release()
