"""Files are there whole, also where the system takes bytes in pieces or the old file cannot be read."""

from __future__ import annotations

import errno
import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from dsl_core.errors import StoreError
from dsl_core.io import atomic
from dsl_core.io.atomic import make_folder, remove_partials, set_aside, store_error, write_atomic
from dsl_core.io.scan.folder import ScanReader, ScanWriter
from dsl_core.model.frames import Frame
from dsl_core.model.plan import CapturePlan, Shot

DATA = bytes(range(256)) * 5


@pytest.fixture(params=["a byte", "half"])
def short_writes(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """The system takes one byte, or half of what it is given, at a time; lists what it took."""
    taken: list[int] = []
    write = os.write

    def short(descriptor: int, data: bytes | memoryview) -> int:
        size = 1 if request.param == "a byte" else -(-len(data) // 2)
        taken.append(write(descriptor, data[:size]))
        return taken[-1]

    monkeypatch.setattr(os, "write", short)
    return taken


def test_short_writes_of_a_file_are_continued(tmp_path: Path, short_writes: list[int]) -> None:
    path = tmp_path / "file"
    write_atomic(path, DATA)
    assert path.read_bytes() == DATA
    assert len(short_writes) > 1
    assert sum(short_writes) == len(DATA)


def test_short_writes_of_frames_and_log_lose_nothing(
    tmp_path: Path, plan: CapturePlan, frame_of: Callable[[Shot], Frame], short_writes: list[int]
) -> None:
    shots = list(plan.shots())[:3]
    with ScanWriter.create(tmp_path / "scan.dsl", plan) as writer:
        for shot in shots:
            writer.write(shot, frame_of(shot))
    reader = ScanReader(tmp_path / "scan.dsl")
    assert list(reader.entries) == [shot.index for shot in shots]
    for shot in shots:
        np.testing.assert_array_equal(reader.read(shot), frame_of(shot).pixels)


def test_a_failed_write_keeps_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "file"
    write_atomic(path, b"old")

    def refuse(descriptor: int) -> None:
        raise OSError(5, "Input/output error")

    monkeypatch.setattr(os, "fsync", refuse)
    with pytest.raises(StoreError, match=r"file could not be written \(Input/output error\)"):
        write_atomic(path, b"new")
    assert {each.name: each.read_bytes() for each in tmp_path.iterdir()} == {"file": b"old"}


@pytest.fixture
def read_only(monkeypatch: pytest.MonkeyPatch) -> None:
    """A drive that has become read-only refuses to delete even names that are not there."""

    def refuse(*arguments: object, **named: object) -> None:
        raise OSError(errno.EROFS, os.strerror(errno.EROFS))

    for name in ("unlink", "replace", "fsync"):
        monkeypatch.setattr(os, name, refuse)


@pytest.mark.usefixtures("read_only")
def test_a_drive_that_becomes_read_only_is_told_in_a_sentence(tmp_path: Path) -> None:
    (tmp_path / "a.partial").write_text("x")
    told = r"could not be written \(Read-only file system\)"
    with pytest.raises(StoreError, match=told):
        write_atomic(tmp_path / "file", b"new")
    with pytest.raises(StoreError, match=told):
        remove_partials(tmp_path)


def test_what_is_set_aside_never_replaces_what_was_set_aside_before(tmp_path: Path) -> None:
    for content in ("first", "second"):
        (tmp_path / "marks.json").write_text(content)
        assert "kept as" in set_aside(tmp_path / "marks.json")
    assert (tmp_path / "marks.damaged.json").read_text() == "first"
    assert (tmp_path / "marks.damaged2.json").read_text() == "second"
    assert set_aside(tmp_path / "marks.json") == ""


def test_only_leftovers_are_removed(tmp_path: Path) -> None:
    for name in ("a.partial", "a"):
        (tmp_path / name).write_text("x")
    remove_partials(tmp_path)
    assert [each.name for each in tmp_path.iterdir()] == ["a"]


@pytest.mark.parametrize(
    "error",
    [
        OSError(errno.ENOSPC, "No space left on device"),
        OSError("8000 requested and 512 written"),  # ndarray.tofile
        OSError("Not enough free space to write 27818581 bytes after offset 2571"),
        OSError("encoder error -2 when writing image file"),  # Pillow
    ],
)
def test_every_writer_says_that_the_disk_is_full(error: OSError) -> None:
    assert str(store_error(Path("a/b.img"), error)).startswith("The disk is full")


def test_another_failure_is_not_called_a_full_disk(tmp_path: Path) -> None:
    for error in (PermissionError(13, "Permission denied"), OSError("no reason")):
        assert "permissions" in str(store_error(tmp_path / "b.img", error))


@pytest.mark.skipif(not Path("/proc/self/fd").is_dir(), reason="lists open files as Linux does")
def test_no_write_leaves_a_file_open(tmp_path: Path) -> None:
    before = len(os.listdir("/proc/self/fd"))
    for number in range(20):
        write_atomic(tmp_path / str(number), b"content")
    assert len(os.listdir("/proc/self/fd")) < before + 10


def test_a_link_in_the_place_of_the_neighbour_is_not_followed(tmp_path: Path) -> None:
    (tmp_path / "theirs").write_text("theirs")
    (tmp_path / "file.partial").symlink_to(tmp_path / "theirs")
    write_atomic(tmp_path / "file", b"mine")
    assert (tmp_path / "theirs").read_text() == "theirs"
    assert (tmp_path / "file").read_bytes() == b"mine"


def test_new_folders_are_synced_where_their_names_are(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    synced: list[Path] = []
    monkeypatch.setattr(atomic, "sync_folder", synced.append)
    make_folder(tmp_path / "a" / "b")
    assert synced == [tmp_path, tmp_path / "a"]
    make_folder(tmp_path / "a" / "b")
    assert len(synced) == 2


def test_what_a_disk_lacks_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path, full = tmp_path / "file", OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
    assert "The disk is full" in str(store_error(path, full))
    quota = OSError(errno.EDQUOT, os.strerror(errno.EDQUOT))
    assert "Your quota is used up" in str(store_error(path, quota))

    class NoNames:
        f_files, f_favail, f_bavail, f_frsize = 1000, 0, 1 << 20, 4096

    monkeypatch.setattr(os, "statvfs", lambda _: NoNames, raising=False)
    assert "can hold no more files, although it has space" in str(store_error(path, full))
