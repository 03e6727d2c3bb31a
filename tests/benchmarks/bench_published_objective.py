"""The banded solver against the published objective: same scan, same pixels, same machine, one run.

Run ``python -m tests.benchmarks.bench_published_objective [SCENE ...] [--thin N] [--steps N]``. The twin
is scanned at 445 x 290. Both solvers get two threads and the same valid pixels; the published one fits every
``thin``-th pixel only and its time is scaled to all of them, which favours neither: it treats pixels
independently, in chunks. Ours runs before and after it, and the mean time counts, so that a change of the
machine's load weighs on both. Errors are taken at the pixels that both solved.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from dsl_core import pipeline, sessions
from dsl_core.evaluation.summary import Evaluation, Truth
from dsl_core.model.result import build_result
from dsl_core.model.spectral import WavelengthGrid
from dsl_core.optics.correspondence import correspondence
from dsl_core.reconstruction.published_objective import AdamOptions, PublishedReconstruction
from dsl_core.reconstruction.spectra import SpectralReconstruction
from tests.cases.twin_scan import solver_input, twin_scan

SIZE = "445x290"
FIGURES = ("rmse", "rmse_scaled", "angle_rad", "pixel_rmse", "pixel_angle_rad")


def evaluated(cube: NDArray[np.float32], where: NDArray[np.bool_], truth: Truth) -> Evaluation:
    """Figures of a cube at some pixels."""
    masked = np.where(where, cube, np.float32(np.nan))
    return pipeline.evaluate(build_result({"reflectance": masked}, WavelengthGrid().centres_nm, {}), truth)


def compare(scene: str, thin: int, steps: int) -> None:
    """Scan a scene, solve it twice, print errors and times."""
    grid = WavelengthGrid()
    devices, scan = twin_scan(size=SIZE, scene=scene)
    rig, truth = devices.calibration, sessions.twin_truth(devices, grid)
    assert rig is not None
    assert truth is not None
    stack, pixels = solver_input(rig, scan)
    chosen = np.zeros_like(pixels.valid)
    chosen.ravel()[::thin] = True
    few = replace(pixels, valid=pixels.valid & chosen)
    model = correspondence(rig)
    # Once for a few pixels, so that neither pays for imports and tables.
    first = replace(few, valid=few.valid & (np.cumsum(few.valid).reshape(few.valid.shape) <= 64))
    inputs = (rig, scan.plan, grid, model, stack.radiance, stack.std)
    SpectralReconstruction(*inputs, first).run()
    PublishedReconstruction(*inputs, first, options=AdamOptions(steps=2)).run()
    ours_us = []
    start = time.perf_counter()
    banded = SpectralReconstruction(*inputs, pixels).run()
    ours_us.append(1e6 * (time.perf_counter() - start) / pixels.valid.sum())
    start = time.perf_counter()
    published = PublishedReconstruction(*inputs, few, options=AdamOptions(steps=steps)).run()
    published_us = 1e6 * (time.perf_counter() - start) / few.valid.sum()
    start = time.perf_counter()
    SpectralReconstruction(*inputs, pixels).run()
    ours_us.append(1e6 * (time.perf_counter() - start) / pixels.valid.sum())
    ours = float(np.mean(ours_us))
    print(f"{scene}: {pixels.valid.sum()} pixels, {few.valid.sum()} of them by the published objective")
    for name, cube, us in (
        ("banded solver", banded.reflectance, ours),
        (f"published objective, {steps} steps", published.reflectance, published_us),
    ):
        figures = evaluated(cube, few.valid, truth)
        errors = ", ".join(f"{figure} {figures.mean(figure):.4f}" for figure in FIGURES)
        width = "" if figures.mean_fwhm_nm is None else f", FWHM {figures.mean_fwhm_nm:.1f} nm"
        print(f"  {name}: {us:.1f} us a pixel, {us * pixels.valid.sum() / 1e6:.1f} s in all; {errors}{width}")
    print(f"  ratio of times: {published_us / ours:.0f}", flush=True)


def main() -> None:
    """Compare on the scenes named."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scenes", nargs="*", default=["color-checker", "filters"])
    parser.add_argument("--thin", type=int, default=31)
    parser.add_argument("--steps", type=int, default=2000)
    arguments = parser.parse_args()
    for scene in arguments.scenes:
        compare(scene, arguments.thin, arguments.steps)


if __name__ == "__main__":
    main()
