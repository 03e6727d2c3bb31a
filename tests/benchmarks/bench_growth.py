"""How time and memory of a reconstruction grow with pixels, bands and patterns, as fitted exponents.

``python -m tests.benchmarks.bench_growth [--quick] [--json FILE]``. Each point is a process of its own, which
reconstructs made frames of the published rig (a smooth signal with noise, read when asked for): seconds are
those of its processor, so that other work on the machine does not count; memory is its peak beyond that of
the same program before it started. The exponent is the slope of a straight line through the logarithms, with
its standard deviation; where overheads rule at the small end it is below that of the large end.
"""

from __future__ import annotations

import json
import subprocess
import sys
import time
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.plan import CapturePlan, GrayCode, LineComb, ScanLines, Shot
from dsl_core.model.rig import Rig
from dsl_core.model.spectral import WavelengthGrid
from tests.benchmarks.common import options, print_table, write_json

#: Columns of images of 10^4 to 4 * 10^6 pixels, 2 rows to 3 columns.
WIDTHS = (122, 245, 387, 775, 1225, 2450)
STEPS_NM = (10.0, 5.0, 2.0, 1.0, 0.5)
#: Scan lines in steps of, and combs of a period of, px: 318, 159 and 128 frames, and 64, 32 and 16.
LINE_STEPS, COMB_PERIODS = (2, 4, 5), (128, 64, 32)
MEDIUM_PX = 122
#: Share of rows and columns that bands are compared on: a quarter of the pixels.
LIT = 0.5
#: A column that no order brings light from.
FAR_PX = -1e4


@dataclass(frozen=True)
class Point:
    """One reconstruction: columns of the image, step of the bands, lines, or a comb if it has a period.

    Of rows and columns the middle share ``lit`` sees anything: coarser pixels, which see broader lines, would
    be another problem.
    """

    width_px: int
    step_nm: float = 5.0
    lines_step_px: int = 2
    comb_period_px: int = 0
    lit: float = 1.0

    @property
    def plan(self) -> CapturePlan:
        """Columns coded once; a single setting, so that the frames are as many as the patterns."""
        height = self.width_px * 2 // 3
        lines = ScanLines(step_px=self.lines_step_px)
        comb = LineComb(width_px=5, step_px=2, period_px=max(self.comb_period_px, 6))
        plan = CapturePlan(code=GrayCode(rows=False), spectral=comb if self.comb_period_px else lines)
        return plan.model_copy(
            update={
                "camera_size_px": (self.width_px, height),
                "settings": plan.settings[1:],
                "code_settings": (0,),
            }
        )


@dataclass(frozen=True)
class MadeFrames:
    """Frames by formula, a `FrameSource`: the zero order of a plane and two faint slopes beside it."""

    plan: CapturePlan
    rig: Rig
    columns: NDArray[np.float32]

    def read(self, shot: Shot) -> NDArray[np.uint16]:
        """The raw mosaic of a shot, the same every time."""
        from dsl_core.optics.sensor import digitise
        from dsl_core.patterns.images import pattern_image

        profile = (pattern_image(self.plan, shot)[0, :, 1] / 255.0) ** 2.2
        smooth = np.convolve(profile, np.full(9, 1 / 9), "same")
        at = np.arange(profile.size)
        light = np.interp(self.columns, at, np.convolve(profile, (0.2, 0.6, 0.2), "same"), 0.0, 0.0)
        for shift in (180.0, -180.0):
            light = light + 0.05 * np.interp(self.columns + shift, at, smooth, 0.0, 0.0)
        rng = np.random.Generator(np.random.SFC64([shot.index]))
        return digitise(self.rig.sensor, (2500 * light).astype(np.float32), rng)


def made_frames(plan: CapturePlan, lit: float = 1.0) -> MadeFrames:
    """A plane at 700 mm in the middle share ``lit`` of the published camera at the plan's size."""
    import torch

    from dsl_core.optics.correspondence import zero_order
    from dsl_core.simulation.published_rig import published_rig

    rig = published_rig()
    rig = rig.model_copy(update={"camera": rig.camera.resized(*plan.camera_size_px)})
    count = plan.camera_size_px[0] * plan.camera_size_px[1]
    depth = torch.full((count,), 700.0, dtype=torch.float32)
    columns = zero_order(rig, torch.arange(count), depth)[0].numpy().reshape(plan.camera_size_px[::-1])
    away = [np.abs(np.arange(n) - (n - 1) / 2) > lit * n / 2 for n in columns.shape]
    columns[away[0]], columns[:, away[1]] = FAR_PX, FAR_PX
    return MadeFrames(plan, rig, columns)


def measure(point: Point) -> dict[str, float]:
    """Seconds of processor and peak memory of one reconstruction, without the making of its frames."""
    import resource

    from dsl_core import pipeline

    source = made_frames(point.plan, point.lit)
    pipeline.reconstruct(made_frames(Point(60).plan), made_frames(Point(60).plan).rig)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    began, reading = time.process_time(), _Reading(source)
    grid = WavelengthGrid(step_nm=point.step_nm)
    result = pipeline.reconstruct(reading, source.rig, pipeline.Options(grid=grid))
    spent = time.process_time() - began - reading.seconds
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return {
        "pixels": float(point.plan.camera_size_px[0] * point.plan.camera_size_px[1]),
        "bands": float(grid.count),
        "patterns": float(point.plan.spectral_count),
        "answered": float(np.isfinite(result["reflectance"].values[0])[source.columns > FAR_PX].mean()),
        "seconds": spent,
        "mebibytes": (peak - before) / 1024,
    }


class _Reading:
    """Counts the seconds of a thread that making frames takes, which is no part of a reconstruction."""

    def __init__(self, source: MadeFrames) -> None:
        self.source, self.plan, self.seconds = source, source.plan, 0.0

    def read(self, shot: Shot) -> NDArray[np.uint16]:
        began = time.thread_time()
        frame = self.source.read(shot)
        self.seconds += time.thread_time() - began
        return frame


def exponent(sizes: list[float], values: list[float]) -> tuple[float, float, float]:
    """Slope of the logarithms, its standard deviation, and the rms scatter about the line as a share."""
    x, y = np.log(sizes), np.log(values)
    slope, level = np.polyfit(x, y, 1)
    scatter = float(np.sqrt(np.sum((y - slope * x - level) ** 2) / max(len(x) - 2, 1)))
    return float(slope), scatter / float(np.sqrt(np.sum((x - x.mean()) ** 2))), scatter


def main() -> int:
    """Print the points and the exponents."""
    parser = options(__doc__)
    parser.add_argument("--point", help="one point as JSON, for the processes that this starts")
    parser.add_argument("--largest", type=int, default=WIDTHS[-1], help="columns of the largest image")
    given = parser.parse_args()
    if given.point:
        print(json.dumps(measure(Point(**json.loads(given.point)))))
        return 0
    small = 61 if given.quick else MEDIUM_PX
    widths = [w for w in WIDTHS if w <= (245 if given.quick else given.largest)]
    series = {
        "pixels": [Point(width) for width in widths],
        "bands": [Point(small, step_nm=s, lit=LIT) for s in STEPS_NM[: 3 if given.quick else None]],
        "patterns": [
            *(Point(small, lines_step_px=step) for step in LINE_STEPS),
            *(Point(small, comb_period_px=period) for period in COMB_PERIODS),
        ],
    }
    figures: dict[str, Any] = {}
    rows: list[list[object]] = []
    for name, points in series.items():
        found = [_in_process(point) for point in points]
        figures[name] = found
        lines = [[p for p in found if p["patterns"] >= 128], [p for p in found if p["patterns"] < 128]]
        for kind, part in zip(("", ", combs"), lines, strict=True):
            if len(part) >= 2:
                for figure in ("seconds", "mebibytes"):
                    sizes, values = ([p[key] for p in part] for key in (name, figure))
                    slope, std, scatter = exponent(sizes, values)
                    rows.append([f"{name}{kind}", figure, f"{min(sizes):g} - {max(sizes):g}",
                        f"{slope:.2f} ± {std:.2f}", f"{scatter:.0%}"])  # fmt: skip
    print()
    print_table(["against", "of", "range", "exponent", "scatter"], rows)
    write_json(given.json, {**figures, "exponents": rows})
    return 0


def _in_process(point: Point) -> dict[str, float]:
    """Measure a point in a fresh process and print it."""
    command = [sys.executable, "-m", "tests.benchmarks.bench_growth", "--point", json.dumps(vars(point))]
    told = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    found: dict[str, float] = json.loads(told.splitlines()[-1])
    print("  ".join(f"{name} {value:.4g}" for name, value in found.items()), flush=True)
    return found


if __name__ == "__main__":
    raise SystemExit(main())
