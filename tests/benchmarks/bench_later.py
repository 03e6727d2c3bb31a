"""Scans after the rig has changed: errors with the calibration of before, with and without self-consistency.

Run ``python -m tests.benchmarks.bench_later [--size 222x145] [--seeds 0,1] [--changes film,all]`` from the
repository's root. Seed 0 is the published rig, any other the rig drawn by that number. The twin is scanned as
it is, once for each seed; the calibration is that of the rig before each change, so that nothing but the
change is wrong. The scan is ``--days`` later than the calibration, by which the result states how well it
knows the light. ``--keep`` and ``--scans`` store and read scans as `tests.benchmarks.bench_foreign` does.

Columns: how it was reconstructed (``own`` follows what the scan finds, ``cal`` is ``as_calibrated``), RMSE of
depth (mm) and share inside its 95 % band; RMSE and angle (rad) of patch means; RMSE of patch means with
the level of each patch fitted, which a changed light does not touch; share of pixels and bands inside their
95 % band; seconds; what the result says does not fit. Below, the verdict of every ``own`` in words.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np

from dsl_core import pipeline
from dsl_core.model.fit import Fit
from dsl_core.model.options import Options
from dsl_core.model.rig import Provenance, Rig
from dsl_core.model.spectral import SpectralCurve
from dsl_core.reconstruction.calibration_age import aged
from tests.benchmarks.bench_foreign import Captured, capture_variant, said
from tests.benchmarks.common import options, print_table, write_json

HEADER = (
    "change", "seed", "as", "depth mm", "band %", "patch", "angle", "level free", "band %", "s", "said",
)  # fmt: skip


def film(**changes: float) -> Callable[[Rig], Rig]:
    """The rig before its film changed by these numbers."""

    def before(rig: Rig) -> Rig:
        now = {name: getattr(rig.film, name) - change for name, change in changes.items()}
        return rig.model_copy(update={"film": rig.film.model_copy(update=now)})

    return before


def light(change: float) -> Callable[[Rig], Rig]:
    """The rig before its light changed by a share."""
    return lambda rig: rig.model_copy(update={"white_scale": rig.white_scale / (1 + change)})


def red_darker(rig: Rig) -> Rig:
    """The rig before its red LED fell by 5 %."""
    red, green, blue = rig.emission
    before = SpectralCurve.of(np.array(red.wavelengths_nm), np.array(red.values) / 0.95)
    return rig.model_copy(update={"emission": (before, green, blue)})


def days_later(rig: Rig, days: float) -> Rig:
    """What a rig states of its white, so long after its calibration."""
    begin = datetime(2026, 3, 1, 10, tzinfo=UTC)
    dated = rig.model_copy(update={"provenance": Provenance(created=begin.isoformat())})
    return aged(dated, (begin + timedelta(days=days)).isoformat())


def blurred(rig: Rig) -> Rig:
    """The rig before its blur grew by 10 %."""
    response = rig.projector_response
    return rig.model_copy(update={"projector_response": response.with_gaussian(response.blur_px / 1.1)})


#: What has changed, by name: one thing after the other turns the rig into what it was.
CHANGES: dict[str, tuple[Callable[[Rig], Rig], ...]] = {
    "none": (),
    "film .1 mm": (film(distance_mm=0.1),),
    "film .5 mm": (film(distance_mm=0.5),),
    "film .1 deg": (film(tilt_y_deg=0.1),),
    "film all": (film(tilt_x_deg=0.2, tilt_y_deg=0.2, roll_deg=0.2, bend_per_mm=0.0003, distance_mm=0.2),),
    "light": (light(-0.05),),
    "light +5 %": (light(0.05),),
    "red LED": (red_darker,),
    "blur": (blurred,),
    "three weeks": (film(distance_mm=0.1, tilt_y_deg=0.1), light(-0.05), blurred),
}  # fmt: skip


def measure(taken: Captured, rig: Rig, as_calibrated: bool) -> dict[str, Any]:
    """All figures of a scan reconstructed with a rig."""
    start = time.process_time()
    result = pipeline.reconstruct(taken.scan, rig, Options(as_calibrated=as_calibrated))
    seconds = time.process_time() - start
    found = pipeline.evaluate(result, taken.truth)
    assert found.depth is not None
    assert found.depth_calibration is not None
    fit, spectral = Fit.read(result.attrs), found.spectral_calibration
    return {
        "as": "cal" if as_calibrated else "own",
        "depth_rmse_mm": found.depth.rmse_mm,
        "depth_band": found.depth_calibration.coverage_95,
        "patch_rmse": found.mean("rmse"),
        "angle_rad": found.mean("angle_rad"),
        "level_free_rmse": level_free(result, taken),
        "spectral_band": None if spectral is None else spectral.coverage_95,
        "cpu_s": seconds,
        "said": said(result),
        "words": "" if fit is None else fit.words,
    }


def level_free(result: Any, taken: Captured) -> float:
    """RMSE of the means of patches, each times the factor that fits best."""
    from dsl_core.evaluation.summary import interior

    truth = taken.truth
    assert truth.material is not None
    assert truth.spectra is not None
    assert truth.lit is not None
    cube, inside = result["reflectance"].values, interior(truth.material) & truth.lit
    errors = []
    for index in truth.targets or ():
        here = inside & (truth.material == index) & np.isfinite(cube).all(0)
        if here.any():
            mean, wanted = cube[:, here].mean(1, dtype=np.float64), truth.spectra[index]
            errors.append(np.sqrt(np.mean((mean * (mean @ wanted) / (mean @ mean) - wanted) ** 2)))
    return float(np.mean(errors))


def row(change: str, seed: int, f: dict[str, Any]) -> list[str]:
    """The cells of a table."""
    band = f["spectral_band"]
    return [
        change, str(seed), f["as"], f"{f['depth_rmse_mm']:.3f}", f"{100 * f['depth_band']:.1f}",
        f"{f['patch_rmse']:.5f}", f"{f['angle_rad']:.4f}", f"{f['level_free_rmse']:.5f}",
        "-" if band is None else f"{100 * band:.1f}", f"{f['cpu_s']:.1f}", f["said"],
    ]  # fmt: skip


def scans(arguments: argparse.Namespace) -> Iterator[tuple[int, Captured]]:
    """The scan of every seed, stored or taken now."""
    for seed in arguments.seeds:
        folder = f"usual-{seed}-{arguments.size}"
        if arguments.scans:
            yield seed, Captured.load(arguments.scans / folder)
            continue
        taken = capture_variant("usual", seed, arguments.size, {})
        if arguments.keep:
            taken.save(arguments.keep / folder)
        yield seed, taken


def main() -> None:
    """Print two rows for each change, and what the result says."""
    parser = options(__doc__)
    parser.add_argument("--size", default="222x145")
    parser.add_argument("--seeds", type=lambda text: [int(s) for s in text.split(",")], default=[0])
    parser.add_argument(
        "--changes", type=lambda text: text.split(","), default=list(CHANGES), help=", ".join(CHANGES)
    )
    parser.add_argument("--days", type=float, default=21.0, help="age of the calibration")
    parser.add_argument("--keep", type=Path, metavar="DIR")
    parser.add_argument("--scans", type=Path, metavar="DIR")
    arguments = parser.parse_args()
    if arguments.quick:
        arguments.changes, arguments.size = ["three weeks"], "112x72"
    rows: list[dict[str, Any]] = []
    for seed, taken in scans(arguments):
        for change in arguments.changes:
            rig = taken.rig
            for before in CHANGES[change]:
                rig = before(rig)
            rig = days_later(rig, arguments.days)
            for as_calibrated in (True, False):
                figures = measure(taken, rig, as_calibrated)
                print("  ".join(row(change, seed, figures)), flush=True)
                rows.append({"change": change, "seed": seed, **figures})
    print()
    print_table(HEADER, [row(r["change"], r["seed"], r) for r in rows])
    for r in rows:
        if r["as"] == "own":
            print(f"\n{r['change']}, seed {r['seed']}: {r['words']}")
    write_json(arguments.json, {"size": arguments.size, "rows": rows})


if __name__ == "__main__":
    main()
