"""Designed pattern sets against combs of equal count, measured on the twin with spectra no design has seen.

Run ``python -m tests.benchmarks.bench_designs FOLDER [--quick] [--json FILE]`` from the repository's root.
All sets have the published settings and the same code, so that frames, exposures and seconds are equal.
Points are kept in the folder: a run that was stopped goes on.
"""

from __future__ import annotations

from pathlib import Path

from dsl_core.model.plan import LineComb, SpectralSet
from dsl_core.planning.designed import designed_sets
from dsl_core.simulation.published_rig import published_rig
from dsl_core.simulation.sim_devices import LATENCY_MS
from tests.benchmarks.common import options, print_table, write_json
from tests.benchmarks.front_cases import PUBLISHED, plan_of
from tests.benchmarks.sweep import Case, Point, run_sweep

PALETTES = ("chart", "filters", "unseen")
#: Width, step and period of the combs that were best, or nearly, on one of the palettes at each count.
COMBS = {
    16: ((6, 4, 64),),
    32: ((9, 2, 64), (5, 2, 64), (7, 3, 96)),
    64: ((9, 1, 64), (11, 2, 128), (9, 2, 128)),
}  # fmt: skip


def main() -> None:
    """Measure what is missing and print, for each count and palette, the combs and the design."""
    parser = options(__doc__)
    parser.add_argument("folder", type=Path)
    chosen = parser.parse_args()
    rows = []
    for frames, palette in ((n, p) for n in ((16,) if chosen.quick else COMBS) for p in PALETTES):
        combs = {name: _measured(name, comb, palette, chosen.folder) for name, comb in _combs(frames).items()}
        designs = {
            name: _measured(name, columns, palette, chosen.folder)
            for name, columns in designed_sets().items()
            if len(columns.levels) == frames
        }
        best = min(_error(point) for point in combs.values())
        rows += [_row(palette, name, point, best) for name, point in (*combs.items(), *designs.items())]
    header = [
        "palette", "set", "frames", "s", "pixel RMSE", "to best comb", "patch", "angle", "FWHM", "depth mm",
    ]  # fmt: skip
    print_table(header, rows)
    write_json(chosen.json, {"rows": [dict(zip(header, row, strict=True)) for row in rows]})


def _combs(frames: int) -> dict[str, SpectralSet]:
    """White combs of a count, and the first of them with its LEDs a third of the period apart."""
    found: dict[str, SpectralSet] = {
        f"comb {w}x{s}x{p}": LineComb(width_px=w, step_px=s, period_px=p) for w, s, p in COMBS[frames]
    }
    w, s, p = COMBS[frames][0]
    shifts = (0, round(p / 3), 2 * round(p / 3))
    found[f"colour comb {w}x{s}x{p}"] = LineComb(width_px=w, step_px=s, period_px=p, shifts_px=shifts)
    return found


def _measured(name: str, spectral: SpectralSet, palette: str, folder: Path) -> Point:
    case = Case(name=f"{name}, {palette}", plan=plan_of(name, spectral, PUBLISHED), palette=palette)
    return run_sweep(published_rig(), [case], folder, LATENCY_MS)[0]


def _error(point: Point) -> float:
    return float("inf") if point.pixel_rmse is None else point.pixel_rmse


def _row(palette: str, name: str, p: Point, best: float) -> list[object]:
    if p.pixel_rmse is None:
        return [palette, name, p.spectral_frames, f"{p.seconds:.0f}", *["-"] * 6]
    fwhm = "-" if p.fwhm_nm is None or palette != "filters" else f"{p.fwhm_nm:.1f}"
    return [
        palette, name, p.spectral_frames, f"{p.seconds:.0f}", f"{p.pixel_rmse:.5f}",
        f"{100 * (p.pixel_rmse / best - 1):+.0f} %", f"{p.rmse:.5f}", f"{p.pixel_angle_rad:.4f}", fwhm,
        f"{p.depth_rmse_mm:.3f}",
    ]  # fmt: skip


if __name__ == "__main__":
    main()
