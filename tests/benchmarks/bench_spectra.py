"""Spectra of the Color Checker and of nine narrow filters, with one setting of the solver for both.

Run ``python -m tests.benchmarks.bench_spectra [--size 890x580] [--quick] [--json FILE]`` from the
repository's root. The twin shows all its effects (halo, blur, bent film, sensor noise); the calibration
is the true one; the plan is the published one with the columns' code. Beside the default, which finds
the strength of its prior in the data of each pixel, stand two priors of fixed strength: one right for
smooth spectra, one right for filters.
"""

from __future__ import annotations

import argparse
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from dsl_core import pipeline
from dsl_core.devices.base import DeviceRig
from dsl_core.evaluation.summary import Evaluation, Truth, interior
from dsl_core.evaluation.uncertainty import DECIDED_FROM, HonestyCheck, check_honesty
from dsl_core.io.scan.folder import ScanReader
from dsl_core.model.plan import CapturePlan, GrayCode
from dsl_core.model.result import DEPTH_INVALID, Reach
from dsl_core.model.rig import Rig
from dsl_core.model.spectral import WavelengthGrid
from dsl_core.optics.correspondence import correspondence
from dsl_core.reconstruction.geometry import Geometry, reconstruct_geometry
from dsl_core.reconstruction.merge import LineStack, MergedScan, decode_columns, stack_lines
from dsl_core.reconstruction.scan_result import known_pixels
from dsl_core.reconstruction.spectral.solving.prior import Prior
from dsl_core.reconstruction.spectral.spectra import SpectralReconstruction
from dsl_core.simulation.sim_devices import open_twin
from dsl_core.workflows import truths
from tests.benchmarks.common import options, print_table, write_json
from tests.cases.twin_scan import assembled

if TYPE_CHECKING:
    import xarray as xr

GRID = WavelengthGrid()
SCENES = ("color-checker", "filters")
#: Every n-th pixel of the image enters the coverage of bright bands.
THIN = 7
#: Truth above this counts as bright: below it the bound at zero decides.
BRIGHT = 0.02
DEFAULT = "strength from the data"


def fixed(tau: float) -> Prior:
    """A prior of one strength: candidates that hardly differ, as the search needs three."""
    return Prior(taus=(tau / 1.001, tau, tau * 1.001))


PRIORS = {DEFAULT: Prior(), "fixed for smooth spectra": fixed(0.002), "fixed for filters": fixed(0.6)}


@dataclass(frozen=True)
class Prepared:
    """A scan up to its spectra."""

    rig: Rig
    plan: CapturePlan
    geometry: Geometry
    stack: LineStack
    truth: Truth

    def solve(self, prior: Prior) -> tuple[xr.Dataset, float]:
        """The result with one prior, and the median reduced chi-square of its pixels."""
        solver = SpectralReconstruction(
            self.rig, self.plan, GRID, correspondence(self.rig), self.stack.radiance, self.stack.std,
            known_pixels(self.geometry), prior=prior,
        )  # fmt: skip
        spectra = solver.run()
        solved = np.isfinite(spectra.reflectance[0])
        fit = float(np.median(spectra.chi_square[solved]))
        return assembled(self.rig, self.plan, GRID, self.geometry, spectra), fit


def prepare(scene: str, size: str) -> Prepared:
    """Scan a scene into a temporary session and reconstruct its depth."""
    with tempfile.TemporaryDirectory() as place, open_twin({"scene": scene, "size": size}) as devices:
        folder = Path(place) / "scan.dsl"
        plan = pipeline.fit_plan(CapturePlan(code=GrayCode(rows=False)), devices)
        pipeline.scan(devices, plan, folder)
        rig, truth = calibration_and_truth(devices)
        merged = MergedScan(ScanReader(folder), rig)
        code, white = decode_columns(merged)
        stack = stack_lines(merged)
    return Prepared(rig, plan, reconstruct_geometry(rig, plan, code, white, stack), stack, truth)


def calibration_and_truth(devices: DeviceRig) -> tuple[Rig, Truth]:
    """What the twin knows of itself and of its scene."""
    truth = truths.twin_truth(devices, GRID)
    assert devices.calibration is not None
    assert truth is not None
    return devices.calibration, truth


def bright_coverage(result: xr.Dataset, truth: Truth) -> HonestyCheck:
    """Coverage over decided bands whose true reflectance is not next to zero."""
    assert truth.material is not None
    assert truth.spectra is not None
    assert truth.targets is not None
    where = interior(truth.material) & np.isin(truth.material, truth.targets)
    if truth.lit is not None:
        where &= truth.lit
    pixels = np.flatnonzero(where)[::THIN]
    true = truth.spectra[truth.material.ravel()[pixels]].T
    values, std, share = (
        result[name].values.reshape(len(true), -1)[:, pixels]
        for name in ("reflectance", "reflectance_std", "data_share")
    )
    return check_honesty(values, true, std, (share >= DECIDED_FROM) & (true > BRIGHT))


def gap(result: xr.Dataset) -> tuple[int, int]:
    """Pixels with a depth that miss some band in both orders, and how many of them have no spectrum."""
    valid = (result["flags"].values & int(DEPTH_INVALID)) == 0
    missing = valid & (result["reach"].values == int(Reach.ZERO_ONLY)).any(0)
    lost = missing & ~np.isfinite(result["reflectance"].values).all(0)
    return int(missing.sum()), int(lost.sum())


def print_patches(found: Evaluation) -> None:
    """A row a patch and their means."""
    rows = [
        [
            p.name, str(p.pixels), f"{p.coverage:.1%}", f"{p.rmse:.4f}", f"{p.angle_rad:.4f}",
            f"{p.delta_e:.2f}", f"{p.pixel_rmse:.4f}", f"{p.peak.fwhm_nm:.2f}" if p.peak else "",
        ]
        for p in found.patches
    ]  # fmt: skip
    mean = [f"{found.mean(name):.4f}" for name in ("rmse", "angle_rad")]
    width = "" if found.mean_fwhm_nm is None else f"{found.mean_fwhm_nm:.2f}"
    rows.append(["mean", "", "", *mean, f"{found.mean('delta_e'):.2f}", f"{found.pixel_rmse:.4f}", width])
    print_table(["patch", "pixels", "solved", "RMSE", "angle rad", "dE00", "pixel RMSE", "FWHM nm"], rows)


def figures(found: Evaluation, bright: HonestyCheck, fit: float) -> dict[str, Any]:
    """Means over a scene as plain numbers."""
    assert found.spectral_calibration is not None
    return {
        "rmse": found.mean("rmse"),
        "angle_rad": found.mean("angle_rad"),
        "delta_e": found.mean("delta_e"),
        "pixel_rmse": found.pixel_rmse,
        "fwhm_nm": found.mean_fwhm_nm,
        "coverage_95": found.spectral_calibration.coverage_95,
        "decided_share": found.spectral_calibration.share,
        "coverage_95_bright": bright.coverage_95,
        "chi_square_median": fit,
    }


def measure(scene: str, size: str, quick: bool) -> dict[str, Any]:
    """All priors on one scene."""
    prepared = prepare(scene, size)
    out: dict[str, Any] = {}
    for name, prior in PRIORS.items():
        if quick and name != DEFAULT:
            continue
        result, fit = prepared.solve(prior)
        found = pipeline.evaluate(result, prepared.truth)
        out[name] = figures(found, bright_coverage(result, prepared.truth), fit)
        if name == DEFAULT:
            print(f"\n{scene}, {size} pixels, {name}")
            print_patches(found)
            missing, lost = gap(result)
            print(
                f"{missing} pixels with a depth miss a band in both orders; {lost} of them have no spectrum"
            )
            out[name]["patches"] = [
                {"name": p.name, "rmse": p.rmse, "angle_rad": p.angle_rad, "delta_e": p.delta_e,
                 "pixel_rmse": p.pixel_rmse, "fwhm_nm": p.peak.fwhm_nm if p.peak else None}
                for p in found.patches
            ]  # fmt: skip
            out[name]["gap_pixels"], out[name]["gap_pixels_lost"] = missing, lost
    return out


def print_priors(found: dict[str, dict[str, Any]]) -> None:
    """One row a prior and scene."""
    rows = []
    for scene, by_prior in found.items():
        for name, f in by_prior.items():
            width = "" if f["fwhm_nm"] is None else f"{f['fwhm_nm']:.2f}"
            rows.append(
                [
                    f"{scene}, {name}", f"{f['rmse']:.4f}", f"{f['angle_rad']:.4f}", f"{f['delta_e']:.2f}",
                    f"{f['pixel_rmse']:.4f}", width, f"{f['coverage_95']:.1%}", f"{f['decided_share']:.1%}",
                    f"{f['coverage_95_bright']:.1%}", f"{f['chi_square_median']:.2f}",
                ]
            )  # fmt: skip
    print()
    print_table(
        ["scene, prior", "RMSE", "angle rad", "dE00", "pixel RMSE", "FWHM nm", "in 95 % band", "decided",
         f"in 95 %, truth > {BRIGHT:g}", "chi2 median"], rows,
    )  # fmt: skip


def main() -> None:
    """Print a table a scene, then one that compares the priors."""
    parser: argparse.ArgumentParser = options(__doc__)
    parser.add_argument("--size", default="", help="camera pixels (890x580; 222x145 with --quick)")
    arguments = parser.parse_args()
    size = arguments.size or ("222x145" if arguments.quick else "890x580")
    found = {scene: measure(scene, size, arguments.quick) for scene in SCENES}
    print_priors(found)
    write_json(arguments.json, {"size": size, "scenes": found})


if __name__ == "__main__":
    main()
