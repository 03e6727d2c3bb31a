from __future__ import annotations

import os
from pathlib import Path

import pytest

from dsl_core.errors import StoreError
from dsl_core.io.scan.lock import FolderLock


def test_a_lock_that_cannot_be_written_says_why(tmp_path: Path) -> None:
    with pytest.raises(StoreError, match=r"gone/lock could not be written \(No such file or directory\)"):
        FolderLock(tmp_path / "gone" / "lock")


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
