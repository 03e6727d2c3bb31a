"""Scans on request, each in a process of its own that may be killed.

Reads lines ``[folder, frames, seconds]`` from standard input; for each, forks a child that creates or
resumes the scan, kills it when so many frames are stored and that time has passed since, and
prints how it ended. Frames are null for a scan that may end. The rig is opened once.
"""

from __future__ import annotations

import json
import os
import signal
import sys
import time
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from dsl_core.capture.runner import Runner
from dsl_core.devices.base import DeviceRig
from dsl_core.devices.registry import open_rig
from dsl_core.devices.replay import replay_rig
from dsl_core.io.scan.folder import ScanWriter
from dsl_core.model.plan import CapturePlan, GrayCode, LineComb, Setting, Shot
from dsl_core.patterns.images import pattern_image
from tests.cases.memory_sink import MemorySink


class Made:
    """Frames made up from the shot's number."""

    def __init__(self, plan: CapturePlan) -> None:
        self.plan = plan

    def read(self, shot: Shot) -> NDArray[np.uint16]:
        width, height = self.plan.camera_size_px
        return np.random.default_rng(shot.index).integers(0, 4096, (height, width)).astype(np.uint16)


def make(kind: str) -> tuple[CapturePlan, DeviceRig]:
    plan = CapturePlan(
        camera_size_px=(48, 36),
        code=GrayCode(rows=False),
        spectral=LineComb(width_px=40, step_px=40, period_px=160),
        settings=(Setting(exposure_ms=100.0, level=0.5),),
        code_settings=(0,),
    )
    if kind == "twin":
        return plan, open_rig("twin", {"size": "48x36", "scene": "plane"})
    return plan, replay_rig(Made(plan))


def wait_for_frames(folder: Path, frames: int, child: int) -> None:
    """Return when a scan has so many frames, or when its process has ended."""
    log = folder / "frames.jsonl"
    while not log.exists() or log.read_bytes().count(b"\n") < frames:
        if os.waitid(os.P_PID, child, os.WEXITED | os.WNOHANG | os.WNOWAIT) is not None:
            return
        time.sleep(0.0005)


def main() -> None:
    plan, rig = make(sys.argv[1])
    # Once through, so that no child spends its life on what can be prepared.
    Runner(rig, plan, MemorySink(plan), pattern_image).run()
    print("ready", flush=True)
    for line in sys.stdin:
        folder, frames, delay_s = json.loads(line)
        child = os.fork()
        if child == 0:
            with ScanWriter.open(folder, plan, rig) as sink:
                Runner(rig, plan, sink, pattern_image).run()
            os._exit(0)
        if frames is not None:
            if frames > 0:
                wait_for_frames(Path(folder), frames, child)
            time.sleep(delay_s)
            os.kill(child, signal.SIGKILL)
        _, status = os.waitpid(child, 0)
        print(os.waitstatus_to_exitcode(status), flush=True)


if __name__ == "__main__":
    main()
