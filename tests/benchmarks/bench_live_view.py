"""How many live frames of a large camera the window shows a second, and how long one keeps its thread.

Run ``python -m tests.benchmarks.bench_live_view``. Noise stands in for a camera of 2048 x 1536 pixels.
"""

from __future__ import annotations

import os
import time

import numpy as np

from tests.benchmarks.common import options, print_table, write_json

SIZE_PX = (2048, 1536)
FRAMES, DIFFERENT = 200, 6


def main() -> None:
    """Measure and print a table."""
    wanted = options(__doc__).parse_args()
    os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")
    os.environ.setdefault("QT_API", "pyside6")
    from dsl_app.rig.live_view import LiveView
    from dsl_app.shell.application import make_application, set_theme

    from dsl_core.devices.base import CameraInfo
    from dsl_core.model.frames import Frame

    application = make_application([])
    view = LiveView()
    view.apply_theme(set_theme("dark"))
    view.resize(1100, 830)
    view.show()
    width, height = SIZE_PX
    view.set_camera(CameraInfo("bench", "0", width, height, "RGGB", 12, (0.1, 5000.0)))
    rng = np.random.default_rng(0)
    frames = [
        Frame(rng.integers(0, 4096, (height, width)).astype(np.uint16), 10.0, float(i), i)
        for i in range(DIFFERENT)
    ]
    busy_ms = []
    start_s = time.perf_counter()
    for i in range(20 if wanted.quick else FRAMES):
        begun_s = time.perf_counter()
        view.show_frame(frames[i % DIFFERENT])
        application.processEvents()
        busy_ms.append(1e3 * (time.perf_counter() - begun_s))
    rate = len(busy_ms) / (time.perf_counter() - start_s)
    p50, p99 = np.percentile(busy_ms, (50, 99))
    print_table(
        ["frames/s", "median ms", "p99 ms", "worst ms"],
        [[f"{rate:.0f}", f"{p50:.1f}", f"{p99:.1f}", f"{max(busy_ms):.1f}"]],
    )
    write_json(wanted.json, {"frames_per_s": rate, "p50_ms": p50, "p99_ms": p99, "worst_ms": max(busy_ms)})


if __name__ == "__main__":
    main()
