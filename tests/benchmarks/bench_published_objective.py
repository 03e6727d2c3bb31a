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

from dsl_core import pipeline
from dsl_core.evaluation.summary import Evaluation, Truth
from dsl_core.model.result import build_result
from dsl_core.model.spectral import WavelengthGrid
from dsl_core.optics.correspondence import correspondence
from dsl_core.reconstruction.spectral.published_objective import AdamOptions, PublishedReconstruction
from dsl_core.reconstruction.spectral.solving.tile_frames import Pixels
from dsl_core.reconstruction.spectral.spectra import SpectralReconstruction
from dsl_core.workflows import scans
from tests.cases.twin_scan import solver_input, twin_scan

SIZE = "445x290"
FIGURES = ("rmse", "rmse_scaled", "angle_rad", "pixel_rmse", "pixel_angle_rad")


class Clock:
    """Mean time of the runs inside it, wall and CPU, microseconds a valid pixel."""

    def __init__(self, pixels: Pixels) -> None:
        self._pixels = int(pixels.valid.sum())
        self._start = (0.0, 0.0)
        self._spans: list[tuple[float, float]] = []

    def __enter__(self) -> None:
        self._start = time.perf_counter(), time.process_time()

    def __exit__(self, *failure: object) -> None:
        self._spans.append((time.perf_counter() - self._start[0], time.process_time() - self._start[1]))

    @property
    def wall_us(self) -> float:
        """Wall time, which another program's load lengthens."""
        return 1e6 * float(np.mean([wall for wall, _ in self._spans])) / self._pixels

    @property
    def cpu_us(self) -> float:
        """CPU time of all threads."""
        return 1e6 * float(np.mean([cpu for _, cpu in self._spans])) / self._pixels


def evaluated(cube: NDArray[np.float32], where: NDArray[np.bool_], truth: Truth) -> Evaluation:
    """Figures of a cube at some pixels."""
    masked = np.where(where, cube, np.float32(np.nan))
    return pipeline.evaluate(build_result({"reflectance": masked}, WavelengthGrid().centres_nm, {}), truth)


def compare(scene: str, thin: int, steps: int) -> None:
    """Scan a scene, solve it twice, print errors and times."""
    grid = WavelengthGrid()
    devices, scan = twin_scan(size=SIZE, scene=scene)
    rig, truth = devices.calibration, scans.twin_truth(devices, grid)
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
    ours = Clock(pixels)
    with ours:
        banded = SpectralReconstruction(*inputs, pixels).run()
    theirs = Clock(few)
    with theirs:
        published = PublishedReconstruction(*inputs, few, options=AdamOptions(steps=steps)).run()
    with ours:
        SpectralReconstruction(*inputs, pixels).run()
    print(f"{scene}: {pixels.valid.sum()} pixels, {few.valid.sum()} of them by the published objective")
    for name, cube, clock in (
        ("banded solver", banded.reflectance, ours),
        (f"published objective, {steps} steps", published.reflectance, theirs),
    ):
        figures = evaluated(cube, few.valid, truth)
        errors = ", ".join(f"{figure} {figures.mean(figure):.4f}" for figure in FIGURES)
        width = "" if figures.mean_fwhm_nm is None else f", FWHM {figures.mean_fwhm_nm:.1f} nm"
        print(f"  {name}: {clock.wall_us:.1f} us a pixel, CPU {clock.cpu_us:.1f} us; {errors}{width}")
    wall, cpu = theirs.wall_us / ours.wall_us, theirs.cpu_us / ours.cpu_us
    print(f"  ratio of times: {wall:.0f}, of CPU times: {cpu:.0f}", flush=True)


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
