"""``kill -9`` at many moments of a scan: every resumed scan equals the unbroken one, bit by bit."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from dsl_core.errors import StoreError
from dsl_core.io.scan.check import find_problems
from dsl_core.io.scan.folder import ScanReader

KILLS = 12
ROOT = Path(__file__).parents[2]

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="Windows has neither fork nor SIGKILL")


class Server:
    """A running ``scan_server.py``."""

    def __init__(self, kind: str) -> None:
        environment = {
            **os.environ,
            "PYTHONPATH": str(ROOT),
            "OMP_NUM_THREADS": "1",
            "PYTHONWARNINGS": "ignore",
        }
        self.process = subprocess.Popen(
            [sys.executable, str(Path(__file__).with_name("scan_server.py")), kind],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env=environment,
        )
        assert self._line() == "ready"

    def scan(self, folder: Path, kill_after: tuple[int, float] | None = None) -> int:
        """Start or resume a scan, kill it after frames and seconds if wanted, and return its exit code."""
        frames, delay_s = kill_after or (None, 0.0)
        assert self.process.stdin is not None
        self.process.stdin.write(json.dumps([str(folder), frames, delay_s]) + "\n")
        self.process.stdin.flush()
        return int(self._line())

    def duration_s(self, folder: Path) -> float:
        """Seconds of an unbroken scan, warmed up by the one that is kept in ``folder``."""
        assert self.scan(folder) == 0
        started = time.monotonic()
        assert self.scan(folder.with_name("again.dsl")) == 0
        return time.monotonic() - started

    def close(self) -> None:
        self.process.communicate(timeout=30)

    def _line(self) -> str:
        assert self.process.stdout is not None
        return self.process.stdout.readline().strip()


def _frames(folder: Path) -> NDArray[np.uint16]:
    reader = ScanReader(folder)
    return np.stack([reader.read(shot) for shot in reader.plan.shots()])


def _frames_left(folder: Path) -> int:
    """Missing frames; -1 when the scan was killed before its folder existed."""
    try:
        return len(ScanReader(folder).missing())
    except StoreError:
        return -1


@pytest.fixture(scope="module", params=["made", pytest.param("twin", marks=pytest.mark.slow)])
def server(request: pytest.FixtureRequest) -> Iterator[Server]:
    server = Server(request.param)
    yield server
    server.close()


@pytest.mark.slow
@pytest.mark.timeout(300)
def test_killed_scans_resume_to_the_unbroken_one(server: Server, tmp_path: Path) -> None:
    duration_s = server.duration_s(tmp_path / "unbroken.dsl")
    unbroken = _frames(tmp_path / "unbroken.dsl")
    assert unbroken.std() > 0
    # By frames and not by time alone, since the time that a scan takes changes with the machine's load.
    # Each in a stretch of its own: a busy machine kills late, and moments close together would be one.
    share = 0.95 * (np.arange(KILLS) + np.random.default_rng(2024).uniform(0.0, 1.0, KILLS)) / KILLS
    left = []
    for number, moment in enumerate(share * len(unbroken)):
        scan = tmp_path / f"{number}.dsl"
        server.scan(scan, kill_after=(int(moment), moment % 1 * duration_s / len(unbroken)))
        left.append(_frames_left(scan))
        assert server.scan(scan) == 0
        assert find_problems(ScanReader(scan), verify=True) == []
        np.testing.assert_array_equal(_frames(scan), unbroken)
    # The kills must have hit scans under way, at many different frames.
    assert len({count for count in left if count > 0}) >= KILLS // 2, left


@pytest.mark.slow
@pytest.mark.parametrize("server", ["made"], indirect=True)
def test_one_scan_killed_again_and_again_gets_there(server: Server, tmp_path: Path) -> None:
    duration_s = server.duration_s(tmp_path / "unbroken.dsl")
    scan = tmp_path / "scan.dsl"
    for _ in range(KILLS):
        server.scan(scan, kill_after=(0, duration_s / 4))
    assert server.scan(scan) == 0
    np.testing.assert_array_equal(_frames(scan), _frames(tmp_path / "unbroken.dsl"))
