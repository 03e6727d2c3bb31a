"""Time and error of the correspondence models: every pixel of 890 x 580, 47 bands, two orders.

Run ``python -m tests.benchmarks.bench_correspondence``. The published code needs about 3 minutes for the
analytic model and 2.5 s for the data-driven one (section 4 of the method).
"""

from __future__ import annotations

import time
from itertools import product

import numpy as np
import torch

from dsl_core.calibration.film.correspondence import fit_grid
from dsl_core.calibration.film.residual import MAX_DEGREE, WAVELENGTH_RANGE_NM
from dsl_core.model.rig import ColumnResidual, Rig
from dsl_core.optics.correspondence import Correspondence, GratingModel, GridModel, HybridModel
from dsl_core.simulation.published_rig import published_rig
from tests.cases.grid_samples import PUBLISHED_NM, sample_grating

BANDS_NM = np.arange(430.0, 661.0, 5.0)
DEPTHS_MM = np.array([500.0, 600.0, 700.0, 850.0, 1000.0])
SPREAD_NM = (430.0, 465.0, 500.0, 540.0, 580.0, 620.0, 660.0)
#: Pixels a call, as the solver does it.
TILE = 6144


def seconds(model: Correspondence, rig: Rig, repeat: int = 3) -> float:
    """Best time to trace the whole image through both orders."""
    count = rig.camera.width_px * rig.camera.height_px
    pixels, depth = torch.arange(count), torch.full((count,), 700.0)
    best = np.inf
    for _ in range(repeat):
        start = time.perf_counter()
        for order in (1, -1):
            for i in range(0, count, TILE):
                model.trace(pixels[i : i + TILE], depth[i : i + TILE], order, BANDS_NM)
        best = min(best, time.perf_counter() - start)
    return best


def error_px(model: Correspondence, rig: Rig) -> tuple[float, float]:
    """RMS and largest difference (px) to the exact grating at random pixels, depths between those sampled."""
    rng = np.random.default_rng(0)
    pixels = torch.as_tensor(rng.integers(0, rig.camera.width_px * rig.camera.height_px, 5000))
    depth = torch.as_tensor(rng.uniform(520, 980, 5000))
    differences = []
    for order in (1, -1):
        exact = GratingModel(rig).exact(pixels, depth, order, BANDS_NM)
        inside = exact.inside(rig.projector.width_px, rig.projector.height_px)
        differences.append((model.trace(pixels, depth, order, BANDS_NM).columns - exact.columns)[inside])
    all_of_them = torch.cat(differences)
    return float(all_of_them.square().mean().sqrt()), float(all_of_them.abs().max())


def _corrected(rig: Rig) -> Rig:
    """The rig with the richest residual that is fitted, of no size: its error is that of the grating."""
    each = range(MAX_DEGREE + 1)
    terms = product(each, each, each, each)
    degrees = tuple((i, j, k, n) for i, j, k, n in terms if i + j + k + n <= MAX_DEGREE)
    residual = ColumnResidual(
        orders=(1, -1),
        column_range_px=(0.0, rig.camera.width_px - 1.0),
        row_range_px=(0.0, rig.camera.height_px - 1.0),
        depth_range_mm=rig.depth_range_mm,
        wavelength_range_nm=WAVELENGTH_RANGE_NM,
        degrees=degrees,
        coefficients_px=((0.0,) * len(degrees),) * 2,
    )
    return rig.model_copy(update={"residual": residual})


def main() -> None:
    """Print seconds and errors."""
    rig = published_rig()
    models: dict[str, Correspondence] = {"grating": GratingModel(rig), "hybrid": HybridModel(_corrected(rig))}
    for name, nm in (("published filters", PUBLISHED_NM), ("spread filters", SPREAD_NM)):
        start = time.perf_counter()
        fit = fit_grid(sample_grating(rig, DEPTHS_MM, np.array(nm)))
        print(f"fit, {name}: {time.perf_counter() - start:.2f} s, residual {fit.rms_px:.4f} px")
        models[f"grid, {name}"] = GridModel(rig.model_copy(update={"correspondence": fit.grid}))
    for name, model in models.items():
        rms, worst = error_px(model, rig)
        print(
            f"{name}: {seconds(model, rig):.2f} s for {BANDS_NM.size} bands and 2 orders;"
            f" error {rms:.4f} px rms, {worst:.3f} px at most"
        )


if __name__ == "__main__":
    main()
