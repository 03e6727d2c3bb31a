"""A result is made by one process at a time, and what the dead had claimed is taken over and told."""

from __future__ import annotations

import errno
import os
import subprocess
import sys
from pathlib import Path

import pytest

from dsl_core.errors import StoreError
from dsl_core.io.claims import LAPSE_S, Claim, ClaimedError, Owner
from dsl_core.io.scan.lock import FolderLock


def test_a_claim_holds_until_it_is_released_and_leaves_nothing(tmp_path: Path) -> None:
    with Claim(tmp_path / "a.zarr") as claim:
        assert claim.taken_over == ""
        with pytest.raises(ClaimedError, match=f"being made by process {os.getpid()} on "):
            Claim(tmp_path / "a.zarr")
        Claim(tmp_path / "b.zarr").release()
    assert list(tmp_path.iterdir()) == []
    Claim(tmp_path / "a.zarr").release()


def test_a_released_claim_lets_go_of_its_file_too(tmp_path: Path) -> None:
    # Systems that keep a file while it is open find it again.
    claim = Claim(tmp_path / "a.zarr")
    (tmp_path / "kept").hardlink_to(tmp_path / ".a.zarr.claim")
    claim.release()
    FolderLock(tmp_path / "kept").release()


def test_the_claim_of_a_killed_process_is_taken_over_and_told(tmp_path: Path) -> None:
    code = "import os, sys; from pathlib import Path; from dsl_core.io.claims import Claim\n"
    code += "claim = Claim(Path(sys.argv[1])); os._exit(9)"
    subprocess.run([sys.executable, "-c", code, str(tmp_path / "a.zarr")], check=False)
    assert len(list(tmp_path.iterdir())) == 2
    with Claim(tmp_path / "a.zarr") as claim:
        assert "which died; it is continued where it was" in claim.taken_over
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(("age_s", "free"), [(0.0, False), (LAPSE_S + 5, True)])
def test_another_computer_is_believed_while_it_touches_its_file(
    tmp_path: Path, age_s: float, free: bool
) -> None:
    """Its lock may not reach here, as on some network drives."""
    claim = Claim(tmp_path / "a.zarr", Owner(host="elsewhere", process=7))
    claim._lock.release()
    owner = tmp_path / ".a.zarr.owner.json"
    seen = owner.stat().st_mtime - age_s
    os.utime(owner, (seen, seen))
    if free:
        with Claim(tmp_path / "a.zarr") as mine:
            assert "process 7 on elsewhere, which died" in mine.taken_over
    else:
        with pytest.raises(ClaimedError, match="process 7 on elsewhere"):
            Claim(tmp_path / "a.zarr")
    claim.release()


def test_an_owner_touches_its_file(tmp_path: Path) -> None:
    owner = tmp_path / ".a.zarr.owner.json"
    with Claim(tmp_path / "a.zarr", beat_s=0.01) as claim:
        os.utime(owner, (1.0, 1.0))
        for _ in range(500):
            claim._ended.wait(0.01)
            if owner.stat().st_mtime > 1.0:
                break
        assert owner.stat().st_mtime > 1.0


def test_a_disk_without_room_for_a_lock_is_told_and_not_asked_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = []

    def full(path: Path, *rest: object) -> int:
        asked.append(path)
        if len(asked) > 1:
            pytest.fail("It was asked again.")
        raise OSError(errno.ENOSPC, "No space left on device", str(path))

    monkeypatch.setattr(os, "open", full)
    with pytest.raises(StoreError, match="full"):
        Claim(tmp_path / "a.zarr")


def test_a_folder_that_cannot_be_made_is_told(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(StoreError, match="cannot be created"):
        Claim(tmp_path / "file" / "a.zarr")
