"""What was found of a scan's pictures holds for its very frames and calibration, and for no other."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from dsl_core.io.scan.folder import ScanReader, ScanWriter
from dsl_core.io.scan.proof_file import PROOF_NAME, read_proof, save_proof
from dsl_core.model.frames import Frame
from dsl_core.model.plan import CapturePlan, Shot
from dsl_core.model.scan_proof import ScanProof
from dsl_core.simulation.published_rig import published_rig

FrameOf = Callable[[Shot], Frame]
FOUND = ScanProof(judged=150, untold=26, wrong=("Frame 7 is late.",), moved=("The camera moved.",))
RIG = published_rig()


@pytest.fixture
def folder(tmp_path: Path, plan: CapturePlan, frame_of: FrameOf) -> Path:
    """A scan with a proof."""
    with ScanWriter.create(tmp_path / "scan.dsl", plan) as writer:
        for shot in writer.missing():
            writer.write(shot, frame_of(shot))
    save_proof(ScanReader(writer.folder), RIG, FOUND)
    return writer.folder


def test_what_was_found_is_kept_with_the_scan(folder: Path) -> None:
    found = read_proof(ScanReader(folder), RIG)
    assert found == FOUND
    assert found.doubts == ("The camera moved.", "Frame 7 is late.")
    assert found.not_judged == "26 of 150"
    assert ScanProof(judged=150, untold=0).not_judged == ""


def test_it_does_not_hold_for_another_calibration(folder: Path) -> None:
    other = RIG.model_copy(update={"sensor": RIG.sensor.model_copy(update={"read_noise_dn": 3.5})})
    assert read_proof(ScanReader(folder), other) is None


def test_it_does_not_hold_once_a_frame_is_another(folder: Path, plan: CapturePlan, frame_of: FrameOf) -> None:
    first, second, *_ = plan.shots()
    with ScanWriter.resume(folder) as writer:
        writer.write(first, replace(frame_of(first), pixels=frame_of(second).pixels))
    assert read_proof(ScanReader(folder), RIG) is None


@pytest.mark.parametrize("fault", ["absent", "flipped", "cut", "other"])
def test_a_file_that_is_damaged_counts_as_none(folder: Path, fault: str) -> None:
    path = folder / PROOF_NAME
    data = path.read_bytes()
    if fault == "absent":
        path.unlink()
    else:
        at = data.index(b"Frame 7") + 6
        path.write_bytes(
            {"flipped": data[:at] + b"8" + data[at + 1 :], "cut": data[:at], "other": b"[]"}[fault]
        )
    assert read_proof(ScanReader(folder), RIG) is None
