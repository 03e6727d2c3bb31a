"""Predicted against measured: many plans on small pieces of the twin, and what the model says of them.

Run ``python -m tests.benchmarks.bench_tradeoff FOLDER [--quick] [--json FILE]`` from the repository's root.
Points are kept in the folder, one file each: a run that was stopped goes on, and `bench_front` has the same.
Measured are the spectra of a Color Checker in two pieces of the picture, by our solver; predicted are the
same figures for pixels in these pieces.
"""

from __future__ import annotations

import time
from itertools import product
from pathlib import Path

import numpy as np

from dsl_core.model.plan import CapturePlan, GrayCode, LineComb, ScanLines, Setting
from dsl_core.model.rig import Rig
from dsl_core.model.spectral import WavelengthGrid
from dsl_core.planning import references
from dsl_core.planning.expected import Prediction
from dsl_core.planning.prediction import predict
from dsl_core.simulation.published_rig import published_rig
from dsl_core.simulation.sim_devices import LATENCY_MS
from tests.benchmarks.common import options, print_table, write_json
from tests.benchmarks.front_cases import front_cases
from tests.benchmarks.sweep import Case, Point, run_sweep, write_csv
from tests.cases.binning import binned
from tests.cases.trial import trial_samples

PERIOD_MS = 1000 / 60
CLOSE = 0.20
SETS: dict[str, ScanLines | LineComb] = {
    **{f"lines {w}x{s}": ScanLines(width_px=w, step_px=s)
       for w, s in ((5, 2), (5, 3), (5, 4), (5, 5), (8, 4), (10, 5), (3, 3), (16, 8), (8, 2), (3, 2))},
    **{f"comb {w}x{s}x{p}": LineComb(width_px=w, step_px=s, period_px=p)
       for w, s, p in ((5, 2, 106), (5, 2, 128), (5, 2, 160), (5, 4, 104), (8, 4, 128), (5, 3, 105),
                       (10, 5, 160), (5, 2, 80), (8, 4, 160), (5, 4, 164), (5, 3, 165), (5, 5, 165))},
}  # fmt: skip
BRACKETS = {
    "published": ((10, 0.2), (20, 0.8)),
    "bright": ((4, 0.2), (20, 0.8)),
    "single": ((20, 0.4),),
}  # fmt: skip


def cases(quick: bool) -> list[Case]:
    """All pattern sets under the first bracket, then under the others."""
    found = []
    brackets = list(BRACKETS.items())[: 1 if quick else None]
    for (bracket, settings), (name, spectral) in product(brackets, SETS.items()):
        plan = CapturePlan(
            name=f"{name}, {bracket}",
            code=GrayCode(rows=False),
            spectral=spectral,
            settings=tuple(Setting(exposure_ms=n * PERIOD_MS, level=level) for n, level in settings),
            code_settings=tuple(range(len(settings))),
        )
        found.append(Case(name=plan.name, plan=plan))
    return found[:4] if quick else found


def all_cases(rig: Rig) -> list[Case]:
    """These and all of the front's that are of the chart and by our solver, each once."""
    ours = (case for case in front_cases(rig) if case.palette == "chart" and case.solver == "best")
    once = {}
    for case in (*cases(False), *ours):
        plan = case.plan.model_copy(update={"name": ""})
        once[plan.model_dump_json(), case.binning, case.step_nm] = case
    return list(once.values())


def _predict(rig: Rig, case: Case) -> Prediction:
    rig = binned(rig, case.binning)
    view, grid = trial_samples(rig, references.chart()), WavelengthGrid(step_nm=case.step_nm)
    return predict(rig, case.plan, view, grid=grid, latency_ms=LATENCY_MS)


def main() -> None:
    """Measure, predict, compare."""
    parser = options(__doc__)
    parser.add_argument("folder", type=Path)
    chosen = parser.parse_args()
    rig = published_rig()
    todo = cases(chosen.quick) if chosen.quick else all_cases(rig)
    points = run_sweep(rig, todo, chosen.folder, LATENCY_MS, _Lines())
    predictions, seconds = [], []
    _predict(rig, todo[0])  # loads what all predictions share
    for case in todo:
        start = time.perf_counter()
        predictions.append(_predict(rig, case))
        seconds.append(time.perf_counter() - start)
    write_csv(points, chosen.folder / "points.csv", overwrite=True)
    report(points, predictions, seconds)
    write_json(chosen.json, {"points": [
        {"measured": m.model_dump(), "predicted": p.model_dump()}
        for m, p in zip(points, predictions, strict=True)
    ]})  # fmt: skip


class _Lines:
    def report(self, stage: str, done: int, total: int) -> None:
        print(f"{stage}: {done} of {total}", flush=True)


def report(points: list[Point], predictions: list[Prediction], seconds: list[float]) -> None:
    """A row a plan and the share of predictions that are close."""
    rows: list[list[object]] = []
    ratios = []
    for point, found in zip(points, predictions, strict=True):
        if point.pixel_rmse is None or point.rmse is None or point.depth_rmse_mm is None:
            rows.append([point.name, point.failure])
            continue
        ratios.append(found.pixel_rmse / point.pixel_rmse)
        rows.append([
            point.name, point.frames, f"{point.seconds:.0f}", f"{point.pixel_rmse:.4f}",
            f"{found.pixel_rmse:.4f}", f"{ratios[-1]:.2f}", f"{point.rmse:.4f}", f"{found.rmse:.4f}",
            f"{point.depth_rmse_mm:.3f}", f"{found.depth_std_mm:.3f}",
        ])  # fmt: skip
    print_table(
        ["plan", "frames", "s", "pixel RMSE", "predicted", "ratio", "patch RMSE", "predicted",
         "depth mm", "predicted"], [r for r in rows if len(r) > 2],
    )  # fmt: skip
    for row in rows:
        if len(row) == 2:
            print(*row)
    first = len(cases(False))
    for words, some in (("sets of lines and combs under three brackets", ratios[:first]), ("all", ratios)):
        close = np.mean(np.abs(np.array(some) - 1) <= CLOSE)
        print(f"{words}: {close:.0%} of {len(some)} predictions within {CLOSE:.0%}")
    print(f"{np.median(seconds):.2f} s each, {np.max(seconds):.2f} s at most")


if __name__ == "__main__":
    main()
