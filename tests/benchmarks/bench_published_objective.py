"""The banded solver against the published objective and solvers of SciPy: same scan, same pixels, one run.

Run ``python -m tests.benchmarks.bench_published_objective [SCENE ...] [--thin N] [--steps N]``. The twin
is scanned at 445 x 290. Both solvers get two threads and the same valid pixels; the published one fits every
``thin``-th pixel only and its time is scaled to all of them, which favours neither: it treats pixels
independently, in chunks. Ours runs before and after it, and the mean time counts, so that a change of the
machine's load weighs on both. Errors are taken at the pixels that all solved.

The nearest line takes a single frame a band. `nnls` and `lsq_linear` of SciPy solve the weighted equations
of all frames with first orders, pixel by pixel in one thread: without a prior, and with one of the banded
solver's candidates of smoothness and its bounds. Only their own time counts, not that of the equations.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.optimize import lsq_linear, nnls

from dsl_core import pipeline
from dsl_core.evaluation.summary import Evaluation, Truth
from dsl_core.model.result import build_result
from dsl_core.model.spectral import WavelengthGrid
from dsl_core.optics.correspondence import correspondence
from dsl_core.optics.lines.profile import halo_of_line
from dsl_core.reconstruction.spectral.nearest_line import NearestLine
from dsl_core.reconstruction.spectral.published_objective import AdamOptions, PublishedReconstruction
from dsl_core.reconstruction.spectral.solving.tile_frames import Pixels
from dsl_core.reconstruction.spectral.spectra import SpectralReconstruction
from dsl_core.workflows import scans
from tests.cases.twin_scan import solver_input, twin_scan

SIZE = "445x290"
#: Nearer to its column than this, the frames of a pixel show the zero order.
ZERO_ORDER_PX = 12.0
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


def single(cube: NDArray[np.float32], where: NDArray[np.bool_], truth: Truth) -> str:
    """Median and 99th percentile of the error of single pixels, over bands."""
    assert truth.material is not None
    assert truth.spectra is not None
    known = where & np.isin(truth.material, truth.targets or range(len(truth.names)))
    apart = cube[:, known] - truth.spectra[truth.material[known]].T
    errors = np.sqrt(np.mean(apart**2, axis=0))
    median, far = np.nanpercentile(errors, [50, 99])
    return f"single pixels: median {median:.4f}, 99th percentile {far:.4f}"


def rows_of_pixels(
    solver: SpectralReconstruction,
) -> Iterator[tuple[int, NDArray[np.float64], NDArray[np.float64]]]:
    """Flat index of each pixel, its weighted equations (rows, bands), and their values (rows,)."""
    for tile in solver._tiles(slice(0, solver.pixels.valid.shape[0])):
        if not solver.pixels.valid[tile].any():
            continue
        frames = solver.frames(*tile)
        radiance, weight = (each.permute(2, 0, 1).numpy().astype(float) for each in frames.colours())
        # Zero order and first orders are told apart by the frame: first orders alone are solved for.
        operator = solver.model.operator(
            solver.trace(frames), frames.known("shading"), frames.blur_px(), solver.model.orders
        )
        amplitude = frames.zero_order_colour()[0].T.numpy()[..., None]
        lines = solver.model.lines
        assert lines is not None
        distance = frames.known("column_px")[:, None] - lines.centre_px(torch.arange(lines.lines))
        halo = halo_of_line(distance, lines.width_px, solver.rig.projector_response).numpy()[:, None]
        far = np.abs(distance.numpy())[:, None] > ZERO_ORDER_PX
        root = np.sqrt(weight) * far
        matrices = operator.matrix().numpy() * root[..., None]
        values = (radiance - amplitude * halo) * root
        for at, matrix, value in zip(frames.flat, matrices, values, strict=True):
            lit = np.abs(matrix).max(2) > 0
            yield int(at), matrix[lit].astype(float), value[lit]


def scipy_solutions(
    solver: SpectralReconstruction, shape: tuple[int, int]
) -> dict[str, tuple[NDArray[np.float32], float]]:
    """Cubes (bands, rows, columns) of SciPy's solvers, and microseconds a pixel."""
    reported = solver.bands.reported
    bands = solver.bands.count
    smooth = np.diff(np.eye(bands), 2, axis=0) / solver.prior.taus[2]
    level = np.eye(bands) / solver.prior.level_std
    prior = np.vstack([smooth, level])
    wanted = np.concatenate(
        [np.zeros(bands - 2), np.full(bands, solver.prior.level / solver.prior.level_std)]
    )
    names = ("scipy nnls, no prior", "scipy lsq_linear, smooth and bounded")
    cubes = {name: np.full((bands, *shape), np.nan, np.float32) for name in names}
    spent, count = dict.fromkeys(names, 0.0), 0
    for at, matrix, value in rows_of_pixels(solver):
        start = time.process_time()
        free = nnls(matrix, value, maxiter=30 * bands)[0]
        middle = time.process_time()
        held = lsq_linear(np.vstack([matrix, prior]), np.append(value, wanted), solver.prior.bounds).x
        end = time.process_time()
        for name, found, seconds in zip(names, (free, held), (middle - start, end - middle), strict=True):
            cubes[name].reshape(bands, -1)[:, at] = found
            spent[name] += seconds
        count += 1
    return {name: (cube[reported], 1e6 * spent[name] / count) for name, cube in cubes.items()}


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
    nearest = Clock(pixels)
    with nearest:
        line = NearestLine(*inputs, pixels).run()
    print(f"{scene}: {pixels.valid.sum()} pixels, {few.valid.sum()} of them by the published objective")
    with torch.inference_mode():
        others = scipy_solutions(SpectralReconstruction(*inputs, few, as_calibrated=True), few.valid.shape)
    for name, cube, cpu_us in (
        ("banded solver", banded.reflectance, ours.cpu_us),
        (f"published objective, {steps} steps", published.reflectance, theirs.cpu_us),
        ("nearest line", line.reflectance, nearest.cpu_us),
        *((name, cube, cpu_us) for name, (cube, cpu_us) in others.items()),
    ):
        figures = evaluated(cube, few.valid, truth)
        errors = ", ".join(f"{figure} {figures.mean(figure):.4f}" for figure in FIGURES)
        width = "" if figures.mean_fwhm_nm is None else f", FWHM {figures.mean_fwhm_nm:.1f} nm"
        print(f"  {name}: CPU {cpu_us:.1f} us a pixel; {errors}{width}; {single(cube, few.valid, truth)}")
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
