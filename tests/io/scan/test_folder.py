"""A session gives back what was written, resumes where it stopped and keeps others out."""

from __future__ import annotations

import errno
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from dsl_core.devices.registry import open_rig
from dsl_core.errors import StoreError
from dsl_core.io.scan.folder import ScanReader, ScanWriter
from dsl_core.model.frames import Frame
from dsl_core.model.placement import Placement
from dsl_core.model.plan import CapturePlan, Shot

FrameOf = Callable[[Shot], Frame]


def test_frames_come_back_as_written(session: Path, plan: CapturePlan, frame_of: FrameOf) -> None:
    reader = ScanReader(session)
    shots = list(plan.shots())
    assert reader.plan == plan
    assert reader.missing() == []
    for shot in shots:
        np.testing.assert_array_equal(reader.read(shot), frame_of(shot).pixels)


def test_any_zarr_reader_opens_the_frames(session: Path, plan: CapturePlan, frame_of: FrameOf) -> None:
    zarr = pytest.importorskip("zarr")
    array = zarr.open_array(str(session / "frames"), mode="r")
    assert array.shape == (plan.shot_count, 16, 24)
    assert array.dtype == np.uint16
    for shot in plan.shots():
        np.testing.assert_array_equal(array[shot.index], frame_of(shot).pixels)


def test_resume_goes_on_at_the_first_missing_frame(
    tmp_path: Path, plan: CapturePlan, frame_of: FrameOf
) -> None:
    folder = tmp_path / "scan.dsl"
    shots = list(plan.shots())
    with ScanWriter.create(folder, plan) as writer:
        for shot in shots[:5]:
            writer.write(shot, frame_of(shot))
    assert ScanReader(folder).missing() == shots[5:]
    with ScanWriter.open(folder, plan) as writer:
        assert list(writer.missing()) == shots[5:]


def test_a_torn_last_line_is_dropped_and_cut_off(
    tmp_path: Path, plan: CapturePlan, frame_of: FrameOf
) -> None:
    folder = tmp_path / "scan.dsl"
    shots = list(plan.shots())
    with ScanWriter.create(folder, plan) as writer:
        for shot in shots[:3]:
            writer.write(shot, frame_of(shot))
    log = folder / "frames.jsonl"
    whole = log.read_bytes()
    for cut in (1, 10, len(whole.splitlines()[-1])):
        log.write_bytes(whole[:-cut])
        with ScanWriter.resume(folder, plan) as writer:
            assert list(writer.missing()) == shots[2:]
            assert log.read_bytes() == b"".join(whole.splitlines(keepends=True)[:2])
            writer.write(shots[2], frame_of(shots[2]))
        assert ScanReader(folder).missing() == shots[3:]


def test_a_chunk_without_its_line_or_damaged_is_taken_again(session: Path, plan: CapturePlan) -> None:
    shots = list(plan.shots())
    log = session / "frames.jsonl"
    log.write_bytes(b"".join(log.read_bytes().splitlines(keepends=True)[:-1]))
    damaged = ScanReader(session).store.path(4)
    damaged.write_bytes(damaged.read_bytes()[:-3])
    ScanReader(session).store.path(6).unlink()
    with ScanWriter.resume(session) as writer:
        assert list(writer.missing()) == [shots[4], shots[6], shots[-1]]


def test_withdrawn_frames_are_missing_at_once_and_after_resuming(
    session: Path, plan: CapturePlan, frame_of: FrameOf
) -> None:
    shots = list(plan.shots())
    with ScanWriter.resume(session, plan) as writer:
        writer.withdraw(shots[3:5])
        assert list(writer.missing()) == shots[3:5]
        writer.write(shots[3], frame_of(shots[3]))
        assert writer.read_back() == [shots[4]]
    assert ScanReader(session).missing() == [shots[4]]
    with ScanWriter.resume(session, plan) as writer:
        assert list(writer.missing()) == [shots[4]]


def test_a_damaged_line_in_the_middle_is_named(session: Path) -> None:
    log = session / "frames.jsonl"
    lines = log.read_bytes().splitlines(keepends=True)
    lines[2] = b'{"shot": oops}\n'
    log.write_bytes(b"".join(lines))
    with pytest.raises(StoreError, match=r"Line 3 of .*frames.jsonl is damaged"):
        ScanReader(session)


def test_another_plan_is_refused_and_the_field_named(session: Path, plan: CapturePlan) -> None:
    slower = plan.settings[1].model_copy(update={"exposure_ms": 25.0})
    other = plan.model_copy(update={"settings": (plan.settings[0], slower)})
    with pytest.raises(
        StoreError, match=r"plan\.settings\[1\]\.exposure_ms is 20\.0 in the scan and 25\.0 now"
    ):
        ScanWriter.open(session, other)
    with ScanWriter.open(session, plan):
        pass  # the refusal gave its lock back


def test_create_never_overwrites(session: Path, plan: CapturePlan, tmp_path: Path) -> None:
    with pytest.raises(StoreError, match="already contains a scan"):
        ScanWriter.create(session, plan)
    (tmp_path / "thesis").mkdir()
    (tmp_path / "thesis" / "chapter.tex").write_text("years of work")
    with pytest.raises(StoreError, match="is not a scan"):
        ScanWriter.create(tmp_path / "thesis", plan)


def test_reading_something_else_says_what_to_give(tmp_path: Path) -> None:
    with pytest.raises(StoreError, match=r"is not a scan: it is an empty folder. Give the folder"):
        ScanReader(tmp_path)


@pytest.mark.parametrize(
    ("content", "where"), [(b"{", "the file"), (b'{"created": "x", "versions": {}}', "plan")]
)
def test_a_damaged_manifest_is_one_sentence(session: Path, content: bytes, where: str) -> None:
    (session / "manifest.json").write_bytes(content)
    with pytest.raises(StoreError, match=f"damaged or from another version: {where}"):
        ScanReader(session)


@pytest.mark.parametrize("pixels", [np.zeros((16, 25), np.uint16), np.zeros((16, 24), np.float32)])
def test_frames_of_another_size_or_type_are_refused(
    tmp_path: Path, plan: CapturePlan, pixels: object
) -> None:
    shot = next(plan.shots())
    with (
        ScanWriter.create(tmp_path / "scan.dsl", plan) as writer,
        pytest.raises(StoreError, match="but the scan needs uint16"),
    ):
        writer.write(shot, Frame(pixels, 10.0))  # type: ignore[arg-type]


def test_two_writers_do_not_share_a_session(tmp_path: Path, plan: CapturePlan) -> None:
    with (
        ScanWriter.create(tmp_path / "scan.dsl", plan),
        pytest.raises(StoreError, match=f"another process .number {os.getpid()}"),
    ):
        ScanWriter.open(tmp_path / "scan.dsl", plan)
    ScanWriter.open(tmp_path / "scan.dsl", plan).close()


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no SIGKILL")
def test_the_lock_of_a_killed_process_is_free(tmp_path: Path, plan: CapturePlan) -> None:
    folder = tmp_path / "scan.dsl"
    ScanWriter.create(folder, plan).close()
    code = (
        "import sys, os; from pathlib import Path; from dsl_core.io.scan.lock import FolderLock\n"
        "lock = FolderLock(Path(sys.argv[1])); print('held', flush=True); sys.stdin.read()"
    )
    with subprocess.Popen(
        [sys.executable, "-c", code, str(folder / "lock")],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        cwd=Path(__file__).parents[3],
    ) as holder:
        assert holder.stdout is not None
        assert holder.stdout.readline() == b"held\n"
        with pytest.raises(StoreError, match=f"number {holder.pid}"):
            ScanWriter.open(folder, plan)
        holder.kill()
    ScanWriter.open(folder, plan).close()


def test_too_small_a_disk_is_told_before_the_start(
    tmp_path: Path, plan: CapturePlan, monkeypatch: pytest.MonkeyPatch
) -> None:
    usage = type("Usage", (), {"free": 1 << 20})()
    monkeypatch.setattr("shutil.disk_usage", lambda place: usage)
    with pytest.raises(StoreError, match=r"needs about \d+ MB .* has 1 MB free"):
        ScanWriter.create(tmp_path / "scan.dsl", plan)
    assert not (tmp_path / "scan.dsl").exists()


@pytest.mark.parametrize("failing", ["write", "fsync", "half", "log"])
def test_a_full_disk_loses_nothing_and_is_resumable(
    tmp_path: Path, plan: CapturePlan, frame_of: FrameOf, monkeypatch: pytest.MonkeyPatch, failing: str
) -> None:
    folder = tmp_path / "scan.dsl"
    shots = list(plan.shots())
    with ScanWriter.create(folder, plan) as writer:
        for shot in shots[:4]:
            writer.write(shot, frame_of(shot))
        with monkeypatch.context() as patch:
            _fill_disk(patch, failing)
            with pytest.raises(StoreError, match=r"The disk is full.*free some space and try again"):
                writer.write(shots[4], frame_of(shots[4]))
    assert not list((folder / "frames").glob("*.partial"))
    assert (folder / "frames.jsonl").read_bytes().count(b"\n") == 4
    assert (folder / "frames.jsonl").read_bytes().endswith(b"\n")
    with ScanWriter.resume(folder, plan) as writer:
        assert list(writer.missing()) == shots[4:]
        for shot in writer.missing():
            writer.write(shot, frame_of(shot))
    reader = ScanReader(folder)
    for shot in shots:
        np.testing.assert_array_equal(reader.read(shot), frame_of(shot).pixels)


def _fill_disk(patch: pytest.MonkeyPatch, failing: str) -> None:
    """Let the disk be full at once, at the sync, in mid-write, or when the log's line is written."""
    full = OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
    write, fsync = os.write, os.fsync
    calls = {"write": 0, "fsync": 0}

    def full_write(descriptor: int, data: memoryview) -> int:
        calls["write"] += 1
        if failing == "half" and calls["write"] == 1:
            return write(descriptor, bytes(data[: len(data) // 2]))
        if failing in ("write", "half") or (failing == "log" and bytes(data[:1]) == b"{"):
            if failing == "log":
                write(descriptor, bytes(data[:7]))
            raise full
        return write(descriptor, data)

    def full_fsync(descriptor: int) -> None:
        if failing == "fsync":
            raise full
        fsync(descriptor)

    patch.setattr(os, "write", full_write)
    patch.setattr(os, "fsync", full_fsync)


@pytest.mark.skipif(sys.platform != "linux", reason="needs a small file system of memory")
def test_a_really_full_disk_loses_nothing(
    tmp_path: Path, plan: CapturePlan, frame_of: FrameOf, monkeypatch: pytest.MonkeyPatch
) -> None:
    disk = tmp_path / "disk"
    disk.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=48k", "tmpfs", str(disk)]
    if subprocess.run(mount, capture_output=True, check=False).returncode != 0:
        pytest.skip("mounting a small file system needs root")
    monkeypatch.setattr("dsl_core.io.scan.folder.check_space", lambda *_: None)
    folder = disk / "scan.dsl"
    shots = list(plan.shots())
    stored: list[Shot] = []
    ballast = disk / "ballast"
    try:
        with ScanWriter.create(folder, plan) as writer:
            ballast.write_bytes(b"x" * 20_000)

            def write_until_full() -> None:
                for shot in shots * 2:
                    writer.write(shot, frame_of(shot))
                    stored.append(shot)

            with pytest.raises(StoreError, match="The disk is full"):
                write_until_full()
        assert 0 < len(stored) < len(shots)
        assert ScanReader(folder).missing() == shots[len(stored) :]
        ballast.unlink()
        with ScanWriter.resume(folder) as writer:
            shot = next(writer.missing())
            assert shot == shots[len(stored)]
            writer.write(shot, frame_of(shot))
        reader = ScanReader(folder)
        for shot in shots[: len(stored) + 1]:
            np.testing.assert_array_equal(reader.read(shot), frame_of(shot).pixels)
    finally:
        unmounted = subprocess.run(["umount", str(disk)], check=False).returncode == 0
        if not unmounted:
            # What stays mounted cannot be cleared away by any later run.
            subprocess.run(["umount", "--lazy", str(disk)], check=True)
    assert unmounted, "a file of the scan is still open"


def test_the_manifest_says_what_was_before_the_camera(
    tmp_path: Path, plan: CapturePlan, frame_of: FrameOf
) -> None:
    rig = open_rig("twin", {"size": "24x16", "scene": "plane"})
    assert rig.place is not None
    rig.place(Placement(target="spectralon"))
    with ScanWriter.create(tmp_path / "scan.dsl", plan, rig, {"scene": "plane"}) as writer:
        assert writer.manifest.notes["before_camera"] == "spectralon"


def test_each_run_of_a_scan_has_its_number(tmp_path: Path, plan: CapturePlan, frame_of: FrameOf) -> None:
    folder, shots = tmp_path / "scan.dsl", list(plan.shots())
    with ScanWriter.create(folder, plan) as writer:
        writer.write(shots[0], frame_of(shots[0]))
    for shot in shots[1:3]:
        with ScanWriter.resume(folder) as writer:
            writer.write(shot, frame_of(shot))
    assert [ScanReader(folder).entries[shot.index].run for shot in shots[:3]] == [1, 2, 3]


def test_what_is_no_scan_gets_no_lock(tmp_path: Path) -> None:
    with pytest.raises(StoreError, match="is not a scan"):
        ScanWriter.resume(tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_a_closed_scan_takes_no_frame(tmp_path: Path, plan: CapturePlan, frame_of: FrameOf) -> None:
    writer = ScanWriter.create(tmp_path / "scan.dsl", plan)
    shot = next(plan.shots())
    writer.close()
    with pytest.raises(StoreError, match="is closed"):
        writer.write(shot, frame_of(shot))
