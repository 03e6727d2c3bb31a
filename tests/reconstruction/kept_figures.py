"""Figures of two scans whose rigs differ from their calibration in many ways, so that most corrections act.

``python -m tests.reconstruction.kept_figures`` keeps them as they are now.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from dsl_core import pipeline
from dsl_core.model.fit import Fit
from dsl_core.model.plan import CapturePlan, GrayCode, ScanLines
from dsl_core.model.result import Flag
from tests.cases.kept_figures import SHARE, SLACK, Figures, keep
from tests.cases.twin_scan import twin_scan

if TYPE_CHECKING:
    import xarray as xr

#: What is different, and how it is scanned. Lines overlap in one, and are side by side in the other.
SCANS = {
    "chart": (
        "color-checker",
        "second-order,spread-skew,lateral-colour,prnu,bend-s",
        CapturePlan(spectral=ScanLines(width_px=3, step_px=2)),
    ),
    "sphere": (
        "sphere",
        "spread-tails,vignetting,response-curve,light-drift,flicker",
        CapturePlan(code=GrayCode(rows=False), spectral=ScanLines(width_px=5, step_px=4)),
    ),
}
SIZE = "64x48"
#: Share of a picture that three pixels are.
PIXELS = 3 / (64 * 48)
#: Quantiles of each map that are kept, and its mean.
QUANTILES = {"5 %": 0.05, "median": 0.5, "95 %": 0.95}


def figures(scan: str) -> dict[str, float]:
    """Figures of a scan of `SCANS` by their names: of its maps, flags and findings."""
    scene, foreign, plan = SCANS[scan]
    devices, frames = twin_scan(plan, size=SIZE, scene=scene, foreign=foreign)
    assert devices.calibration is not None
    result = pipeline.reconstruct(frames, devices.calibration)
    return {**_of_maps(result), **_of_flags(result), **_of_fit(result)}


def _of_maps(result: xr.Dataset) -> dict[str, float]:
    found = {}
    for name, map_ in result.drop_vars(["flags"]).data_vars.items():
        values = map_.values.astype(np.float64)
        known = values[np.isfinite(values)]
        found[f"{name}, mean"] = float(known.mean())
        found |= {f"{name}, {at}": float(np.quantile(known, q)) for at, q in QUANTILES.items()}
        found[f"{name}, known"] = known.size / values.size
    return found


def _of_flags(result: xr.Dataset) -> dict[str, float]:
    flags = result["flags"].values
    return {f"flag {flag.name}": float(((flags & int(flag)) != 0).mean()) for flag in Flag}


def _of_fit(result: xr.Dataset) -> dict[str, float]:
    fit = Fit.read({str(name): value for name, value in result.attrs.items()})
    assert fit is not None
    found: dict[str, float] = {}
    for finding in fit.findings:
        found[f"{finding.name}, found"] = finding.value
        found[f"{finding.name}, deviation"] = finding.std or 0.0
    return found


def kept_file(scan: str) -> Path:
    """Where figures of a scan are kept."""
    return Path(__file__).with_name(f"kept_{scan}.json")


def slack(name: str, before: Figures) -> float:
    """By how much a figure may change, however small it is: shares by pixels, estimates by deviations."""
    if name.startswith("flag ") or name.endswith((", known", "pixels, found", "poor fit, found")):
        return PIXELS
    return max(SHARE * before.get(name.replace(", found", ", deviation"), 0.0), SLACK)


if __name__ == "__main__":
    for each in SCANS:
        keep(kept_file(each), figures(each))
