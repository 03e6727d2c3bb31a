"""A scan is complete when it was read back: what vanished meanwhile is restored or taken again."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from dsl_core.errors import StoreError
from dsl_core.io.records import replace_record
from dsl_core.io.scan.check import find_problems
from dsl_core.io.scan.folder import ScanReader, ScanWriter
from dsl_core.model.frames import Frame
from dsl_core.model.plan import CapturePlan, Shot

FrameOf = Callable[[Shot], Frame]


def _written(folder: Path, plan: CapturePlan, frame_of: FrameOf) -> ScanWriter:
    writer = ScanWriter.create(folder, plan)
    for shot in writer.missing():
        writer.write(shot, frame_of(shot))
    return writer


def _flip(path: Path, place: int) -> None:
    data = bytearray(path.read_bytes())
    data[place] ^= 4
    path.write_bytes(data)


@pytest.mark.parametrize("name", ["manifest.json", "frames.jsonl", "frames/zarr.json"])
@pytest.mark.parametrize("how", ["deleted", "changed", "replaced"])
def test_metadata_that_changed_are_written_again(
    tmp_path: Path,
    plan: CapturePlan,
    frame_of: FrameOf,
    caplog: pytest.LogCaptureFixture,
    name: str,
    how: str,
) -> None:
    folder = tmp_path / "scan.dsl"
    with _written(folder, plan, frame_of) as writer:
        path = folder / name
        if how == "deleted":
            path.unlink()
        elif how == "replaced":
            path.unlink()
            path.write_bytes(b"{}\n")
        else:
            _flip(path, 2)
        assert writer.read_back() == []
        assert [message.split(" of ")[0] for message in caplog.messages] == [name.split("/")[0]]
        extra = next(iter(plan.shots()))
        writer.write(extra, frame_of(extra))
    reader = ScanReader(folder)
    assert find_problems(reader, verify=True) == []
    assert reader.manifest == writer.manifest
    assert len(reader.entries) == plan.shot_count


def test_only_a_manifest_of_another_scan_is_written_again(
    tmp_path: Path, plan: CapturePlan, frame_of: FrameOf
) -> None:
    path = tmp_path / "scan.dsl" / "manifest.json"
    with _written(path.parent, plan, frame_of) as writer:
        own = path.stat().st_ino
        assert writer.read_back() == []
        assert path.stat().st_ino == own, "it was left alone"
        replace_record(path, writer.manifest.model_copy(update={"notes": {"rig": "another"}}))
        assert writer.read_back() == []
    assert ScanReader(path.parent).manifest == writer.manifest


def test_frames_that_vanished_or_changed_are_missing_again(
    tmp_path: Path, plan: CapturePlan, frame_of: FrameOf
) -> None:
    folder = tmp_path / "scan.dsl"
    with _written(folder, plan, frame_of) as writer:
        assert writer.read_back() == []
        store = ScanReader(folder).store
        store.path(3).unlink()
        _flip(store.path(5), 40)
        shutil.copy(store.path(6), store.path(7))
        assert [shot.index for shot in writer.read_back()] == [3, 5, 7]
        for shot in writer.missing():
            writer.write(shot, frame_of(shot))
        assert writer.read_back() == []
    assert find_problems(ScanReader(folder), verify=True) == []


def test_a_log_that_is_not_the_one_being_written_is_noticed(
    tmp_path: Path, plan: CapturePlan, frame_of: FrameOf
) -> None:
    folder = tmp_path / "scan.dsl"
    with ScanWriter.create(folder, plan) as writer:
        shots = list(writer.missing())
        for shot in shots[:4]:
            writer.write(shot, frame_of(shot))
        # As an editor saves: another file under the old name, to which nothing is appended any more.
        shutil.copy(folder / "frames.jsonl", tmp_path / "edited")
        os.replace(tmp_path / "edited", folder / "frames.jsonl")
        for shot in shots[4:]:
            writer.write(shot, frame_of(shot))
        assert writer.read_back() == []
    reader = ScanReader(folder)
    assert reader.missing() == []
    np.testing.assert_array_equal(reader.read(shots[-1]), frame_of(shots[-1]).pixels)


def test_a_folder_that_is_gone_ends_with_a_sentence(
    tmp_path: Path, plan: CapturePlan, frame_of: FrameOf
) -> None:
    folder = tmp_path / "scan.dsl"
    with _written(folder, plan, frame_of) as writer:
        os.rename(folder, tmp_path / "elsewhere.dsl")
        with pytest.raises(StoreError, match="moved or deleted while it was written"):
            writer.read_back()
    assert not folder.exists()
