"""What accuracy costs in time: the presets scanned with the twin and compared with its truth.

Run ``python -m tests.benchmarks.bench_operating_points [--quick] [--json FILE]`` from the repository's root.
Each preset scans the Color Checker and the nine narrow-band filters at 445 x 290 pixels.
"""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

from dsl_core import pipeline
from dsl_core.capture.runner import Runner
from dsl_core.evaluation.summary import Evaluation
from dsl_core.model.plan import CapturePlan
from dsl_core.model.presets import PRESETS
from dsl_core.model.spectral import WavelengthGrid
from dsl_core.patterns.images import pattern_image
from dsl_core.simulation.sim_devices import LATENCY_MS, open_twin
from dsl_core.workflows import truths
from tests.benchmarks.common import options, print_table, write_json
from tests.cases.memory_sink import MemorySink

SIZE = "445x290"
QUICK_SIZE = "112x72"


def measure(plan: CapturePlan, scene: str, size: str) -> Evaluation:
    """Scan a scene of the twin in memory and compare the result with its truth."""
    with open_twin({"scene": scene, "size": size}) as rig:
        fitted = pipeline.fit_plan(plan, rig)
        sink = MemorySink(fitted)
        Runner(rig, fitted, sink, pattern_image).run()
        assert rig.calibration is not None
        result = pipeline.reconstruct(sink, rig.calibration)
        truth = truths.twin_truth(rig, WavelengthGrid())
    assert truth is not None
    return pipeline.evaluate(result, truth)


def point(plan: CapturePlan, size: str) -> dict[str, float]:
    """The figures of one plan."""
    chart, filters = measure(plan, "color-checker", size), measure(plan, "filters", size)
    assert chart.depth is not None
    return {
        "frames": plan.shot_count,
        "seconds": round(plan.duration_s(LATENCY_MS), 1),
        "chart_rmse": round(chart.mean("rmse"), 5),
        "chart_pixel_rmse": round(chart.pixel_rmse, 5),
        "filter_fwhm_nm": round(filters.mean_fwhm_nm or float("nan"), 2),
        "depth_rmse_mm": round(chart.depth.rmse_mm, 4),
        "depth_coverage": round(chart.depth.coverage, 4),
    }


def main() -> None:
    """Measure every preset and print the table."""
    chosen = options(__doc__).parse_args()
    size = QUICK_SIZE if chosen.quick else SIZE
    presets = (PRESETS[0], PRESETS[-1]) if chosen.quick else PRESETS
    points: dict[str, Any] = {}
    for preset in presets:
        start = time.perf_counter()
        points[preset.key] = point(preset.plan, size)
        print(f"{preset.key}: {points[preset.key]} in {time.perf_counter() - start:.0f} s", flush=True)
        write(chosen.json, size, points)
    print_table(
        ("plan", *next(iter(points.values()))),
        [(key, *(f"{value:g}" for value in found.values())) for key, found in points.items()],
    )


def write(path: Path | None, size: str, points: dict[str, Any]) -> None:
    """Write the table; after every preset, so that an interrupted run is not lost."""
    origin = (
        f"Measured on the twin at {size.replace('x', ' × ')} px: a Color Checker and nine filters of 10 nm."
        " Times are those of the rig at hand."
    )
    write_json(path, {"schema_version": 1, "origin": origin, "points": points})


if __name__ == "__main__":
    main()
