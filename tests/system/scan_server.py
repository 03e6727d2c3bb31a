"""Scans on request, each in a process of its own that may be killed.

Reads lines ``[folder, seconds or null]`` from standard input; for each, forks a child that creates or
resumes the session and scans, kills it after that time, and prints how it ended. The rig is opened once.
"""

from __future__ import annotations

import json
import os
import signal
import sys
import time

import numpy as np
from numpy.typing import NDArray

from dsl_core.capture.runner import Runner
from dsl_core.capture.sink import MemorySink
from dsl_core.devices.base import DeviceRig
from dsl_core.devices.registry import open_rig
from dsl_core.devices.replay import replay_rig
from dsl_core.io.session import SessionWriter
from dsl_core.model.plan import CapturePlan, GrayCode, LineComb, Setting, Shot
from dsl_core.patterns.images import pattern_image


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
        spectral=LineComb(width_px=20, step_px=20, period_px=160),
        settings=(Setting(exposure_ms=100.0, level=0.5),),
        code_settings=(0,),
    )
    if kind == "twin":
        return plan, open_rig("twin", {"size": "48x36", "scene": "plane"})
    return plan, replay_rig(Made(plan))


def main() -> None:
    plan, rig = make(sys.argv[1])
    # Once through, so that no child spends its life on what can be prepared.
    Runner(rig, plan, MemorySink(plan), pattern_image).run()
    print("ready", flush=True)
    for line in sys.stdin:
        folder, kill_after_s = json.loads(line)
        child = os.fork()
        if child == 0:
            with SessionWriter.open(folder, plan, rig) as sink:
                Runner(rig, plan, sink, pattern_image).run()
            os._exit(0)
        if kill_after_s is not None:
            time.sleep(kill_after_s)
            os.kill(child, signal.SIGKILL)
        _, status = os.waitpid(child, 0)
        print(os.waitstatus_to_exitcode(status), flush=True)


if __name__ == "__main__":
    main()
