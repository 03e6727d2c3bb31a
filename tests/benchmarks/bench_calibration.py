"""Rigs that nobody knows, calibrated by the command alone, against their true calibration.

Run ``python -m tests.benchmarks.bench_calibration [--rigs 20] [--size 445x290] [--folder DIR]``. For each rig
``dsl-scan calibrate all`` runs in a process of its own and leaves ``rig.json``; then a scan of a chart is
reconstructed twice, with the found and with the true calibration. Errors of spectra are those of patches
that the calibration did not see; depth is that of all lit pixels. A folder that already holds a rig is not
calibrated again, so that the study can be continued.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsl_core import pipeline
from dsl_core.evaluation.summary import Evaluation
from dsl_core.io.rig_file import load_rig
from dsl_core.model.rig import Rig
from dsl_core.model.spectral import SpectralCurve, WavelengthGrid
from dsl_core.optics.sensor import relative_gain
from dsl_core.optics.spectra import chain_response
from dsl_core.workflows import truths
from tests.benchmarks.common import options, print_table, write_json
from tests.cases.twin_scan import twin_scan

Floats = NDArray[np.float64]
#: Two-sided 95 % of a normal distribution.
Z95 = 1.96


@dataclass(frozen=True)
class Errors:
    """Mean over held-out patches of the errors of their mean spectra and of their pixels; depth over all."""

    patch_rmse: float
    pixel_rmse: float
    angle_rad: float
    depth_mm: float
    spectral_coverage: float
    depth_coverage: float

    @classmethod
    def of(cls, evaluation: Evaluation, held_out: set[str]) -> Errors:
        """Errors of a result at the patches that a calibration did not see (all, if it saw none)."""
        patches = [p for p in evaluation.patches if not held_out or p.name in held_out]
        assert evaluation.depth is not None
        assert evaluation.depth_calibration is not None
        assert evaluation.spectral_calibration is not None
        return cls(
            float(np.mean([p.rmse for p in patches])),
            float(np.mean([p.pixel_rmse for p in patches])),
            float(np.mean([p.angle_rad for p in patches])),
            evaluation.depth.rmse_mm,
            evaluation.spectral_calibration.coverage_95,
            evaluation.depth_calibration.coverage_95,
        )


def calibrate(seed: int, size: str, folder: Path, settings: Sequence[str]) -> tuple[float, float]:
    """Run the command; seconds, and the largest memory of the process in MB."""
    import resource

    start = time.perf_counter()
    command = [sys.executable, "-m", "dsl_core", "calibrate", "all", str(folder), "--rig", "twin"]
    chosen = ["--option", f"truth={seed}", "--option", f"size={size}", "--option", f"seed={seed}"]
    chosen += [part for setting in settings for part in ("--set", setting)]
    done = subprocess.run(
        [*command, *chosen, "--yes", "--no-library"],
        env={**os.environ, "PYTHONPATH": str(Path.cwd())},
        capture_output=True,
        text=True,
    )
    if done.returncode != 0:
        raise SystemExit(f"rig {seed}: {done.stderr.strip()[-2000:]}")
    peak_mb = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024
    return time.perf_counter() - start, peak_mb


def record_of(folder: Path, name: str) -> dict[str, Any]:
    """The accepted record of a calibration."""
    content: dict[str, Any] = json.loads((folder / f"{name}.json").read_text(encoding="utf-8"))
    record: dict[str, Any] = content["record"]
    return record


def held_out_patches(folder: Path) -> set[str]:
    """Names of the patches that the Color Checker calibration did not fit."""
    patches = record_of(folder, "color-checker").get("patches", [])
    return {patch["name"] for patch in patches if patch.get("held_out")}


def stated_scores(folder: Path, found: Rig, truth: Rig) -> dict[str, Floats]:
    """Deviation over stated deviation of everything that the calibrations state both of."""
    scores = _light_scores(folder, truth) | _curve_scores(folder, truth)
    film = record_of(folder, "depth-stage")
    for name, std in film["film_std"].items():
        scores[f"film {name}"] = np.array([(film["film"][name] - getattr(truth.film, name)) / std])
    nm = np.arange(430.0, 661.0, 10.0)
    if found.chain_rel_std is not None:
        std = np.hypot(found.chain_rel_std.at(nm), found.white_scale_rel_std)
        # Where gain one lies is a convention, which the white scale follows.
        gain = float(np.median(relative_gain(found) / relative_gain(truth)))
        for order in (1, -1):
            ours, theirs = (chain_response(rig, order, nm).sum((0, 1)) for rig in (found, truth))
            scores[f"chain {order:+d}"] = (gain * ours / theirs - 1) / std
    return scores


def _light_scores(folder: Path, truth: Rig) -> dict[str, Floats]:
    test, light = record_of(folder, "selftest"), truth.projector_response
    measured = {
        "black level": (test["camera"]["black_level_dn"], truth.sensor.black_level_dn),
        "e-/DN": (test["camera"]["electrons_per_dn"], truth.sensor.electrons_per_dn),
        "read noise": (test["camera"]["read_noise_dn"], truth.sensor.read_noise_dn),
        "gamma": (test["projector"]["gamma"], light.gamma),
        "projector black": (test["projector"]["black_fraction"], light.black_fraction),
    }
    return {
        name: np.array([(figure["value"] - true) / figure["std"]])
        for name, (figure, true) in measured.items()
    }


def _curve_scores(folder: Path, truth: Rig) -> dict[str, Floats]:
    """Emission (its integrals sum to 100 nm) and efficiency, between 430 and 660 nm."""
    fine = np.arange(390.0, 711.0)
    total = sum(np.trapezoid(curve.at(fine), fine) for curve in truth.emission) / 100.0
    pairs = [
        (f"emission {name}", curve, true, total)
        for name, curve, true in zip(
            "RGB", record_of(folder, "spectralon")["emission"]["curves"], truth.emission, strict=True
        )
    ]
    efficiency = record_of(folder, "bandpass")["efficiency"]
    pairs += [(f"efficiency {m:+d}", efficiency[str(m)], truth.efficiency[m], 1.0) for m in (1, -1)]
    scores = {}
    for name, stated, true, scale in pairs:
        curve = SpectralCurve.model_validate(stated)
        nm, std = np.array(curve.wavelengths_nm), np.array(curve.std)
        inside = (nm >= 430) & (nm <= 660)
        scores[name] = ((np.array(curve.values) - true.at(nm) / scale) / std)[inside]
    return scores


def study(seed: int, size: str, folder: Path, settings: Sequence[str]) -> dict[str, float]:
    """Calibrate one rig and compare."""
    home = folder / f"rig-{seed}"
    seconds, memory_mb = 0.0, 0.0
    if not (home / "rig.json").exists():
        seconds, memory_mb = calibrate(seed, size, home, settings)
    found = load_rig(home / "rig.json")
    devices, scan = twin_scan(truth=str(seed), size=size, scene="color-checker", seed=str(1000 + seed))
    truth = truths.twin_truth(devices, WavelengthGrid())
    true_rig = devices.camera.world.rig  # type: ignore[attr-defined]
    assert truth is not None
    held_out = held_out_patches(home)
    row: dict[str, float] = {"rig": seed, "seconds": seconds, "memory_mb": memory_mb}
    for name, rig in (("true", true_rig), ("found", found)):
        result = pipeline.reconstruct(scan, rig)
        errors = Errors.of(pipeline.evaluate(result, truth), held_out)
        row |= {f"{name}_{key}": value for key, value in vars(errors).items()}
    for key in ("patch_rmse", "pixel_rmse", "angle_rad", "depth_mm"):
        row[f"ratio_{key}"] = row[f"found_{key}"] / row[f"true_{key}"]
    for key, scores in stated_scores(home, found, true_rig).items():
        row[f"inside {key}"] = float(np.mean(np.abs(scores) < Z95))
    return row


def main() -> None:
    """Study all rigs and print each, the mean and the worst."""
    parser = options(__doc__)
    parser.add_argument("--rigs", type=int, default=20)
    parser.add_argument("--first", type=int, default=1)
    parser.add_argument("--size", default="445x290")
    parser.add_argument("--folder", type=Path, default=Path("calibration-study"))
    parser.add_argument("--set", action="append", default=[], help="passed on, as CALIBRATION.key=value")
    arguments = parser.parse_args()
    count = 2 if arguments.quick else arguments.rigs
    rows = []
    for seed in range(arguments.first, arguments.first + count):
        rows.append(study(seed, arguments.size, arguments.folder, arguments.set))
        print({key: round(value, 5) for key, value in rows[-1].items()}, flush=True)
    keys = [key for key in rows[0] if key != "rig"]
    table = [
        (key, f"{np.mean([r[key] for r in rows]):.5g}", f"{max(r[key] for r in rows):.5g}") for key in keys
    ]
    print_table(("figure", "mean", "largest"), table)
    write_json(arguments.json, {"rigs": rows})


if __name__ == "__main__":
    main()
