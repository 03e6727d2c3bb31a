"""Ctrl-C at any moment of a scan: exit code 130, the command to resume, and the same frames at the end."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from dsl_core.cli import main
from dsl_core.cli.guidance import resumed_by
from dsl_core.errors import DeviceError, DriftError
from dsl_core.io.scan.folder import ScanReader

from .conftest import SMALL_RIG, Give, without_progress

ROOT = Path(__file__).parents[2]
#: Small frames, and enough of them to be interrupted in the middle.
SCAN = [
    "-O",
    "size=56x36",
    "-O",
    "scene=plane",
    "--code",
    "columns",
    "--lines",
    "10x10",
    "--setting",
    "166.7@0.2",
]
FRAMES = 90

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="Windows sends Ctrl-C to the whole console")


def _interrupted(arguments: list[str], log: Path, lines: int) -> tuple[int, str]:
    """Run a command, send it SIGINT once its log has that many lines; exit code and complaint."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"}
    process = subprocess.Popen(
        [sys.executable, "-m", "dsl_core", *arguments],
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    deadline = time.monotonic() + 300
    while process.poll() is None and time.monotonic() < deadline:
        if log.exists() and log.read_bytes().count(b"\n") >= lines:
            process.send_signal(signal.SIGINT)
            break
        time.sleep(0.005)
    _, complaint = process.communicate(timeout=300)
    return process.returncode, complaint


@pytest.fixture(scope="module")
def unbroken(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("unbroken") / "scan.dsl"
    assert main(["scan", str(folder), *SCAN]) == 0
    return folder


@pytest.mark.slow
@pytest.mark.parametrize("lines", [0, 40])
def test_an_interrupted_scan_says_how_to_resume_and_does(
    give: Give, unbroken: Path, tmp_path: Path, lines: int
) -> None:
    # On a busy machine a scan may end before it is interrupted, which says nothing: try again.
    for attempt in range(5):
        scan = tmp_path / f"scan-{attempt}.dsl"
        code, complaint = _interrupted(["scan", str(scan), *SCAN], scan / "frames.jsonl", lines)
        if code != 0:
            break
    assert code == 130, complaint
    assert without_progress(complaint).count("\n") == 1, complaint
    assert f"Resume with: dsl-scan resume {scan}" in complaint
    lacking = len(ScanReader(scan).missing())
    assert lines <= FRAMES - lacking < FRAMES
    assert give("reconstruct", scan).code == 2
    resumed = give("resume", scan, "--json").json
    assert (resumed["state"], resumed["scan"]) == ("finished", str(scan))
    assert (resumed["frames"], resumed["captured"]) == (FRAMES, lacking)
    whole, mended = ScanReader(unbroken), ScanReader(scan)
    assert whole.plan.shot_count == FRAMES
    for shot in whole.plan.shots():
        np.testing.assert_array_equal(mended.read(shot), whole.read(shot))


def test_an_interrupted_reconstruction_leaves_nothing(
    give: Give, finished: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def stop(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("dsl_core.io.result.row_writer.new_array", stop)
    ending = give("reconstruct", finished / "scan.dsl", "-o", tmp_path / "a.zarr", "--depth-only")
    assert ending.code == 130
    assert ending.sentence.startswith("Stopped.")
    assert list(tmp_path.iterdir()) == []


def test_a_scan_of_another_scene_is_not_mixed_in(give: Give, scan_copy: Path) -> None:
    (scan_copy / "frames" / "c.140.0.0").unlink()
    moved = [*SMALL_RIG, "-O", "scene=plane", "-O", "depth_mm=760"]
    ending = give("resume", scan_copy, "--rig", "twin", *moved)
    assert ending.code == 2
    assert "changed since the scan stopped" in ending.sentence
    assert len(ScanReader(scan_copy).missing()) == 1


@pytest.mark.parametrize("kind", [DeviceError, DriftError])
def test_a_lost_device_ends_with_the_command_that_resumes(kind: type[DeviceError]) -> None:
    with (
        pytest.raises(
            kind, match=r"No answer\. Everything captured is kept\. Resume with: dsl-scan resume a"
        ) as told,
        resumed_by("dsl-scan resume a"),
    ):
        raise kind("No answer.")
    assert type(told.value) is kind
