from __future__ import annotations

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
