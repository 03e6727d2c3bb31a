"""The front of accuracy against time, and the baselines, measured on the twin.

Run ``python -m tests.benchmarks.bench_front FOLDER [--quick] [--stored] [--json FILE]`` from the repository's
root. Points are kept in the folder, one file each: a run that was stopped goes on; ``--stored`` measures
none.
The folder also gets a table (points.csv), a picture of each palette and a page with all of it.
"""

from __future__ import annotations

import csv
from io import StringIO
from pathlib import Path

from dsl_core.io.staging import staged
from dsl_core.model.rig import Rig
from dsl_core.simulation.published_rig import published_rig
from dsl_core.simulation.sim_devices import LATENCY_MS
from tests.benchmarks.bench_tradeoff import cases
from tests.benchmarks.common import options, print_table, write_json
from tests.benchmarks.front_cases import PALETTES, front_cases
from tests.benchmarks.measured_front import Comparison, Measured, plot_png, write_measured_report
from tests.benchmarks.sweep import Case, run_sweep, stored

#: Spectral frames that a named plan may take, and the reading of the published plan it is held against.
LIMITS, AGAINST = (64, 32), ("published", "best")


def main() -> None:
    """Measure what is missing, write the table, the pictures and the page, and print what matters."""
    parser = options(__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--stored", action="store_true", help="measure nothing, report what the folder has")
    chosen = parser.parse_args()
    rig = published_rig()
    todo = front_cases(rig)[:4] if chosen.quick else _once(rig, [*front_cases(rig), *cases(False)])
    points = _measured(rig, todo, chosen.folder, chosen.stored)
    found = [Comparison.of(palette, points, "published") for palette in PALETTES]
    _table(points, chosen.folder / "points.csv")
    write_measured_report(found, chosen.folder / "front.html", overwrite=True)
    for each in found:
        if each.best:
            (chosen.folder / f"front-{each.palette}.png").write_bytes(plot_png(each))
        _tell(each)
    print(f"{len(points)} of {len(todo)} points, {sum(m.point.pixel_rmse is None for m in points)} failed")
    write_json(chosen.json, {"points": [{**m.case.model_dump(exclude={"plan"}), **m.point.model_dump()}
                                        for m in points]})  # fmt: skip


def _once(rig: Rig, todo: list[Case]) -> list[Case]:
    """Each case once, whichever list names it."""
    return list({case.model_dump_json(): case for case in todo}.values())


def _measured(rig: Rig, todo: list[Case], folder: Path, only_stored: bool) -> list[Measured]:
    points = []
    for done, case in enumerate(todo, 1):
        if only_stored:
            point = stored(rig, case, folder, LATENCY_MS)
        else:
            point = run_sweep(rig, [case], folder, LATENCY_MS)[0]
            print(f"{done} of {len(todo)}: {case.name}: {point.pixel_rmse}", flush=True)
        if point is not None:
            points.append(Measured(case, point))
    return points


def _table(points: list[Measured], path: Path) -> None:
    rows = [
        {
            **m.point.model_dump(),
            "palette": m.case.palette,
            "solver": m.case.solver,
            "binning": m.case.binning,
            "step_nm": m.case.step_nm,
        }
        for m in points
    ]
    text = StringIO()
    table = csv.DictWriter(text, fieldnames=list(rows[0]), lineterminator="\n")
    table.writeheader()
    table.writerows(rows)
    with staged([path], overwrite=True) as (draft,):
        draft.write_text(text.getvalue(), encoding="utf-8")


def _tell(found: Comparison) -> None:
    header = [
        "plan",
        "spectral",
        "frames",
        "s",
        "pixel RMSE",
        "patch",
        "angle",
        "dE00",
        "FWHM",
        "depth",
        "core s/MP",
    ]
    print(f"\n{found.palette}: {len(found.points)} points. The published plan by solver:")
    print_table(header, [_row(m) for m in found.published.values()])
    print("None is better in both time and error:")
    print_table(header, [_row(m) for m in found.best])
    for limit in LIMITS:
        for solver in AGAINST:
            named = found.named(limit, solver)
            words = "none" if named is None else " ".join(str(cell) for cell in _row(named))
            print(f"At most {limit} spectral frames, no worse than the published plan by {solver}: {words}")


def _row(m: Measured) -> list[object]:
    p = m.point
    if p.pixel_rmse is None:
        return [p.name, p.spectral_frames, p.frames, f"{p.seconds:.0f}", *["-"] * 7]
    fwhm = "-" if p.fwhm_nm is None else f"{p.fwhm_nm:.1f}"
    return [
        p.name, p.spectral_frames, p.frames, f"{p.seconds:.0f}", f"{p.pixel_rmse:.4f}", f"{p.rmse:.4f}",
        f"{p.pixel_angle_rad:.4f}", f"{p.delta_e:.2f}", fwhm, f"{p.depth_rmse_mm:.3f}",
        f"{p.cpu_s_per_megapixel:.0f}",
    ]  # fmt: skip


if __name__ == "__main__":
    main()
