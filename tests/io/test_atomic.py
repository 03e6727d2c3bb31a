"""Files are there whole, also where the system takes bytes in pieces or the old file cannot be read."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from dsl_core.errors import StoreError
from dsl_core.io.atomic import remove_partials, set_aside, write_atomic
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
