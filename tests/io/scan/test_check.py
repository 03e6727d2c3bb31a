"""Every kind of damage to a session is told in one sentence that names frame and file."""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from dsl_core.errors import StoreError
from dsl_core.io.records import replace_record
from dsl_core.io.scan.capture_log import read_log
from dsl_core.io.scan.check import find_problems, require_complete
from dsl_core.io.scan.folder import ScanReader, ScanWriter
from dsl_core.io.scan.frame_store import FrameStore
from dsl_core.io.sealed import seal
from dsl_core.model.frames import Frame
from dsl_core.model.plan import CapturePlan, Shot

FrameOf = Callable[[Shot], Frame]


def _only_problem(folder: Path) -> str:
    found = find_problems(ScanReader(folder), verify=True)
    assert len(found) == 1, found
    return found[0]


def _write(folder: Path, plan: CapturePlan, frames: dict[int, Frame]) -> None:
    with ScanWriter.create(folder, plan) as writer:
        for shot in writer.missing():
            writer.write(shot, frames[shot.index])


def test_a_sound_session_has_no_problems(session: Path) -> None:
    reader = ScanReader(session)
    assert find_problems(reader, verify=True) == []
    require_complete(reader)


def test_missing(session: Path) -> None:
    (session / "frames" / "c.3.0.0").unlink()
    problem = _only_problem(session)
    assert "lacks 1 of" in problem
    assert "frame 4 (code pattern 4, setting 1)" in problem
    assert "Resume" in problem
    with pytest.raises(StoreError, match="lacks 1 of"):
        require_complete(ScanReader(session))
    with pytest.raises(StoreError, match=r"Frame 4 .* cannot be used: its file .*c\.3\.0\.0 cannot be read"):
        ScanReader(session).read(list(ScanReader(session).plan.shots())[3])


def test_extra(session: Path) -> None:
    shutil.copy(session / "frames" / "c.3.0.0", session / "frames" / "c.99.0.0")
    assert "1 more frames than" in _only_problem(session)


@pytest.mark.parametrize("keep", [0, 9, 40, -1])
def test_truncated(session: Path, keep: int) -> None:
    path = session / "frames" / "c.5.0.0"
    path.write_bytes(path.read_bytes()[:keep])
    problem = _only_problem(session)
    assert problem.startswith("Frame 6 (code pattern 6, setting 1)")
    size = path.stat().st_size
    assert f"{path} is cut off after {size} bytes" in problem or f"{path} has {size} of" in problem


def test_a_flipped_bit(session: Path) -> None:
    path = session / "frames" / "c.5.0.0"
    data = bytearray(path.read_bytes())
    data[-20] ^= 4
    path.write_bytes(data)
    problem = _only_problem(session)
    assert "do not match their checksum" in problem or "does not decompress" in problem
    assert str(path) in problem


def test_swapped(session: Path) -> None:
    a, b, spare = (session / "frames" / name for name in ("c.2.0.0", "c.7.0.0", "spare"))
    a.rename(spare)
    b.rename(a)
    spare.rename(b)
    found = find_problems(ScanReader(session), verify=True)
    assert len(found) == 2
    assert "contains the picture of frame 8 (swapped or copied)" in found[0]
    assert "contains the picture of frame 3 (swapped or copied)" in found[1]


@pytest.mark.parametrize("pixels", [np.zeros((16, 25), np.uint16), np.zeros((16, 12), np.uint16)])
def test_another_size(session: Path, pixels: np.ndarray[tuple[int, int], np.dtype[np.uint16]]) -> None:
    FrameStore(session / "frames", 1, *pixels.shape).write(5, pixels)
    assert f"contains {pixels.nbytes} bytes of 16 bit values instead of 768 bytes" in _only_problem(session)


def test_another_type(session: Path) -> None:
    from numcodecs import blosc  # type: ignore[import-untyped]

    pixels = np.zeros((16, 12), np.uint32)
    (session / "frames" / "c.5.0.0").write_bytes(blosc.Blosc("zstd").encode(pixels))
    assert "768 bytes of 32 bit values instead of" in _only_problem(session)


def test_metadata_of_another_array(session: Path) -> None:
    path = session / "frames" / "zarr.json"
    path.write_text(path.read_text().replace('"uint16"', '"int32"'))
    with pytest.raises(StoreError, match="gives data_type as int32, but the plan needs uint16"):
        ScanReader(session)


@pytest.mark.parametrize("same", ["frame_id", "pixels"])
def test_repeated(tmp_path: Path, plan: CapturePlan, frame_of: FrameOf, same: str) -> None:
    frames = {shot.index: frame_of(shot) for shot in plan.shots()}
    value = getattr(frames[5], same)
    frames[6] = replace(frames[6], **{same: value})
    _write(tmp_path / "scan.dsl", plan, frames)
    assert "is the same exposure as frame 6" in _only_problem(tmp_path / "scan.dsl")


def test_equal_pictures_are_believed_when_clipped_or_confirmed(
    tmp_path: Path, plan: CapturePlan, frame_of: FrameOf
) -> None:
    frames = {shot.index: frame_of(shot) for shot in plan.shots()}
    dark = np.full_like(frames[0].pixels, 260)
    frames[1], frames[2] = replace(frames[1], pixels=dark), replace(frames[2], pixels=dark)
    frames[6] = replace(frames[6], pixels=frames[5].pixels, attempts=2)
    _write(tmp_path / "scan.dsl", plan, frames)
    assert find_problems(ScanReader(tmp_path / "scan.dsl"), verify=True) == []


def test_frame_numbers_may_start_anew_after_a_resume(
    tmp_path: Path, plan: CapturePlan, frame_of: FrameOf
) -> None:
    folder = tmp_path / "scan.dsl"
    shots = list(plan.shots())
    with ScanWriter.create(folder, plan) as writer:
        writer.write(shots[0], frame_of(shots[0]))
    with ScanWriter.resume(folder) as writer:
        for shot in shots[1:]:
            frame = frame_of(shot)
            writer.write(shot, replace(frame, frame_id=frame.frame_id - 1))
    assert find_problems(ScanReader(folder)) == []


def test_a_camera_may_round_exposures_by_a_twentieth(
    tmp_path: Path, plan: CapturePlan, frame_of: FrameOf
) -> None:
    for share, told in ((1.04, False), (0.96, False), (1.06, True), (0.94, True)):
        folder = tmp_path / f"{share}.dsl"
        frames = {shot.index: frame_of(shot) for shot in plan.shots()}
        _write(folder, plan, {i: replace(f, exposure_ms=share * f.exposure_ms) for i, f in frames.items()})
        problems = find_problems(ScanReader(folder))
        assert len(problems) == (plan.shot_count if told else 0)


def test_wrong_exposure(tmp_path: Path, plan: CapturePlan, frame_of: FrameOf) -> None:
    frames = {shot.index: frame_of(shot) for shot in plan.shots()}
    frames[4] = replace(frames[4], exposure_ms=12.0)
    _write(tmp_path / "scan.dsl", plan, frames)
    assert "exposed for 12 ms instead of 10 ms" in _only_problem(tmp_path / "scan.dsl")


@pytest.mark.parametrize("name", ["manifest.json", "frames.jsonl"])
def test_files_of_two_scans(session: Path, plan: CapturePlan, tmp_path: Path, name: str) -> None:
    other = tmp_path / "other.dsl"
    reader = ScanReader(session)
    _write(
        other,
        plan,
        {
            shot.index: Frame(reader.read(shot), shot.exposure_ms, 1.0 + shot.index, 1 + shot.index)
            for shot in plan.shots()
        },
    )
    later = ScanReader(other).manifest.model_copy(update={"created": "2031-05-01T10:00:00+00:00"})
    replace_record(other / "manifest.json", later)
    log = other / "frames.jsonl"
    lines = [entry.model_copy(update={"scan": later.created}) for entry in read_log(log)[0]]
    log.write_bytes(b"".join(seal(line.model_dump_json()) for line in lines))
    require_complete(ScanReader(other))
    shutil.copy(other / name, session / name)
    said = rf"{plan.shot_count} of {plan.shot_count} frames in .* belong to a scan that began at .*: files of"
    assert re.search(said, find_problems(ScanReader(session))[0])
    with pytest.raises(StoreError, match="files of two scans were mixed"):
        ScanWriter.resume(session)


def test_frames_of_earlier_versions_do_not_say_their_scan(session: Path) -> None:
    log = session / "frames.jsonl"
    lines = [entry.model_copy(update={"scan": ""}) for entry in read_log(log)[0]]
    log.write_bytes(b"".join(seal(line.model_dump_json()) for line in lines))
    require_complete(ScanReader(session))
