"""A scan on a share that vanishes for a while: nothing is lost, nothing is thrown away, and it goes on."""

from __future__ import annotations

import errno
import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from dsl_core.capture.proof.report import SeenFrames
from dsl_core.errors import DriveError, StoreError
from dsl_core.io import patience
from dsl_core.io.reading import read_bounded
from dsl_core.io.records import read_record
from dsl_core.io.scan import frame_store
from dsl_core.io.scan.check import find_problems
from dsl_core.io.scan.folder import ScanReader, ScanWriter
from dsl_core.io.scan.manifest import Manifest
from dsl_core.model.frames import Frame
from dsl_core.model.plan import CapturePlan, Shot

FrameOf = Callable[[Shot], Frame]


class _Share:
    """A drive that is away until so many seconds have been slept."""

    def __init__(self, patch: pytest.MonkeyPatch) -> None:
        self.left_s = 0.0
        usual = patience.Patience(60.0, 1.0, lambda: -self.left_s, self._sleep)
        patch.setattr(patience, "USUAL", usual)
        for name in ("open", "write", "fsync", "stat"):
            patch.setattr(os, name, self._refusing(getattr(os, name)))

    def _sleep(self, seconds: float) -> None:
        self.left_s -= seconds

    def _refusing(self, call: Callable[..., object]) -> Callable[..., object]:
        def refusing(*given: object, **named: object) -> object:
            if self.left_s > 0:
                raise OSError(errno.ESTALE, os.strerror(errno.ESTALE))
            return call(*given, **named)

        return refusing


def test_frames_are_written_once_the_share_is_back(
    tmp_path: Path, plan: CapturePlan, frame_of: FrameOf, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder, shots = tmp_path / "scan.dsl", list(plan.shots())
    share = _Share(monkeypatch)
    with ScanWriter.create(folder, plan) as writer:
        for shot in shots:
            share.left_s = 20.0 if shot.index in (3, 5) else 0.0
            writer.write(shot, frame_of(shot))
        share.left_s = 20.0
        assert writer.read_back() == []
    assert find_problems(ScanReader(folder), verify=True) == []


def test_a_line_of_the_log_is_written_to_the_file_that_is_there_then(
    tmp_path: Path, plan: CapturePlan, frame_of: FrameOf, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A handle from before a share was away stays stale for ever."""
    folder, shots = tmp_path / "scan.dsl", list(plan.shots())
    share = _Share(monkeypatch)
    with ScanWriter.create(folder, plan) as writer:
        writer.write(shots[0], frame_of(shots[0]))
        stale, write = writer._log._descriptor, os.write

        def refusing(descriptor: int, data: memoryview) -> int:
            if descriptor == stale and bytes(data[:1]) == b"{":
                raise OSError(errno.ESTALE, os.strerror(errno.ESTALE))
            return write(descriptor, data)

        monkeypatch.setattr(os, "write", refusing)
        writer.write(shots[1], frame_of(shots[1]))
        assert share.left_s == -1.0
    assert sorted(ScanReader(folder).entries) == [0, 1]


def test_frames_that_nobody_can_read_now_are_not_taken_for_lost(
    session: Path, plan: CapturePlan, frame_of: FrameOf, monkeypatch: pytest.MonkeyPatch
) -> None:
    share, reader = _Share(monkeypatch), ScanReader(session)
    first = next(iter(plan.shots()))
    share.left_s = 20.0
    np.testing.assert_array_equal(reader.read(first), frame_of(first).pixels)
    for look in (
        lambda: reader.read(first),
        lambda: reader.read_rows(first, slice(0, 4)),
        reader.sound,
        lambda: find_problems(reader, verify=True),
        lambda: SeenFrames(plan).read_missing(reader),
    ):
        share.left_s = 1e9
        with pytest.raises(DriveError, match="Its drive does not answer; what is saved there is kept"):
            look()
    share.left_s = 1e9
    for what in (lambda: ScanReader(session), lambda: read_record(session / "manifest.json", Manifest)):
        with pytest.raises(StoreError, match="Its drive does not answer"):
            what()
    share.left_s = 0.0
    assert reader.sound() == {shot.index for shot in plan.shots()}


def test_a_bad_place_on_a_disk_costs_its_own_frame_only(
    session: Path, plan: CapturePlan, monkeypatch: pytest.MonkeyPatch
) -> None:
    share, reader = _Share(monkeypatch), ScanReader(session)
    bad = reader.store.path(4)

    def refusing(path: Path, *most: int) -> bytes:
        if path == bad:
            raise OSError(errno.EIO, os.strerror(errno.EIO))
        return read_bounded(path, *most)

    monkeypatch.setattr(frame_store, "read_bounded", refusing)
    assert {shot.index for shot in plan.shots()} - reader.sound() == {4}
    assert share.left_s == 0.0, "nobody waits for it"
