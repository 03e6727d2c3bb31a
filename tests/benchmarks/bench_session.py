"""Seconds to write a whole reference scan, to read it, and to check it before a resume.

Run: ``python tests/benchmarks/bench_session.py [folder]``; the folder decides which disk is measured.
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from dsl_core.io.scan.folder import ScanReader, ScanWriter
from dsl_core.model.frames import Frame
from dsl_core.model.plan import CapturePlan


def make_frames(plan: CapturePlan, count: int = 24) -> list[NDArray[np.uint16]]:
    """Lines on a dim object as a 12 bit camera sees them: 10 electrons per DN, read noise 0.5 DN."""
    width, height = plan.camera_size_px
    rng = np.random.default_rng(0)
    columns = np.arange(width)
    frames = []
    for i in range(count):
        signal = 20 + 2000 * np.exp(-(((columns - width * i / count) / 15) ** 2))
        noisy = rng.poisson(10 * signal, (height, width)) / 10 + rng.normal(0, 0.5, (height, width))
        frames.append(np.clip(np.round(260 + noisy), 0, 4095).astype(np.uint16))
    return frames


def timed(name: str, plan: CapturePlan, work: Callable[[], object]) -> None:
    """Print seconds, CPU seconds, frames and MB of raw data per second."""
    start, cpu = time.perf_counter(), time.process_time()
    work()
    seconds, cpu = time.perf_counter() - start, time.process_time() - cpu
    rates = f"{plan.shot_count / seconds:6.0f} frames/s {plan.raw_bytes / seconds / 1e6:6.0f} MB/s"
    print(f"{name:34s} {seconds:6.2f} s (CPU {cpu:5.2f} s) {rates}", flush=True)


def main() -> None:
    """Measure on the reference plan: 716 frames of 890 x 580."""
    plan = CapturePlan()
    frames = make_frames(plan)
    with tempfile.TemporaryDirectory(dir=sys.argv[1] if len(sys.argv) > 1 else None) as place:
        folder = Path(place) / "bench.dsl"

        def write() -> None:
            with ScanWriter.create(folder, plan) as writer:
                for shot in writer.missing():
                    pixels = np.roll(frames[shot.index % len(frames)], shot.index, 0)
                    writer.write(shot, Frame(pixels, shot.exposure_ms, float(shot.index), shot.index))

        timed("write, synced", plan, write)
        reader = ScanReader(folder)
        stored = sum(path.stat().st_size for path in (folder / "frames").iterdir())
        print(f"{stored / 1e6:.0f} MB on disk, {plan.raw_bytes / stored:.2f} times smaller than raw")
        shots = list(plan.shots())

        def read_all(verify: bool) -> None:
            for shot in shots:
                reader.read(shot, verify=verify)

        timed("read, verified", plan, lambda: read_all(True))
        timed("read, unverified", plan, lambda: read_all(False))
        timed("resume (all frames checked)", plan, lambda: ScanWriter.resume(folder, plan).close())


if __name__ == "__main__":
    main()
