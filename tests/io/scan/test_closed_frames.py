"""Frames that are there and cannot be opened now are not taken for lost: they would be captured again."""

from __future__ import annotations

import errno
import os
from collections.abc import Callable
from pathlib import Path

import pytest

from dsl_core.errors import DriveError
from dsl_core.io.records import read_record
from dsl_core.io.scan import capture_log, frame_store
from dsl_core.io.scan.folder import ScanReader, ScanWriter
from dsl_core.io.scan.manifest import Manifest
from dsl_core.model.frames import Frame
from dsl_core.model.plan import CapturePlan, Shot

FrameOf = Callable[[Shot], Frame]
CLOSED = (errno.EACCES, "may not read it. Change its permissions")
SHORT = (errno.EMFILE, "can open no more. Close other programs")


@pytest.fixture
def scan(tmp_path: Path, plan: CapturePlan, frame_of: FrameOf) -> Path:
    with ScanWriter.create(tmp_path / "scan.dsl", plan) as writer:
        for shot in plan.shots():
            writer.write(shot, frame_of(shot))
    return tmp_path / "scan.dsl"


def _refusing(number: int) -> Callable[..., bytes]:
    def read(path: Path, *_: object) -> bytes:
        raise OSError(number, os.strerror(number), str(path))

    return read


@pytest.mark.parametrize(("number", "advice"), [CLOSED, SHORT])
def test_a_resumed_scan_leaves_them_alone(
    scan: Path, plan: CapturePlan, monkeypatch: pytest.MonkeyPatch, number: int, advice: str
) -> None:
    with ScanWriter.resume(scan, plan) as writer:
        monkeypatch.setattr(frame_store, "read_bounded", _refusing(number))
        with pytest.raises(DriveError, match=advice):
            writer.read_back()
    for read in (ScanReader(scan).sound, lambda: ScanWriter.resume(scan, plan)):
        with pytest.raises(DriveError, match=rf"c\.0\.0\.0 cannot be read.*{advice}"):
            read()
    monkeypatch.undo()
    assert len(ScanReader(scan).sound()) == plan.shot_count


def test_a_log_or_record_that_is_closed_is_not_to_be_restored(
    scan: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(capture_log, "read_bounded", _refusing(errno.EACCES))
    with pytest.raises(DriveError, match=r"frames\.jsonl cannot be read.*Change its permissions"):
        ScanReader(scan)
    monkeypatch.setattr("dsl_core.io.records.read_bounded", _refusing(errno.EACCES))
    with pytest.raises(
        Exception, match=r"manifest\.json cannot be read \(Permission denied\)\. It may be whole"
    ):
        read_record(scan / "manifest.json", Manifest)
