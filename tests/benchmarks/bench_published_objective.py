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
from scipy.ndimage import binary_dilation
from scipy.optimize import lsq_linear, nnls

from dsl_core import pipeline
from dsl_core.evaluation.summary import Evaluation, Truth
from dsl_core.model.result import build_result
from dsl_core.model.spectral import WavelengthGrid
from dsl_core.optics.colour_neighbours import AROUND, bayer_colours
from dsl_core.optics.correspondence import correspondence
from dsl_core.reconstruction.spectral.nearest_line import NearestLine
from dsl_core.reconstruction.spectral.published_objective import AdamOptions, PublishedReconstruction
from dsl_core.reconstruction.spectral.solving.tile_frames import Pixels
from dsl_core.reconstruction.spectral.spectra import SpectralReconstruction
from dsl_core.workflows import truths
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
    solver: SpectralReconstruction, wanted: NDArray[np.bool_]
) -> Iterator[tuple[int, NDArray[np.float64], NDArray[np.float64]]]:
    """Flat index of each wanted pixel, its weighted equations (rows, bands), and their values (rows,)."""
    height, width = solver.pixels.valid.shape
    lines = solver.model.lines
    assert lines is not None
    for rows, columns in solver._tiles(slice(0, height)):
        tile = solver.frames(rows, columns)
        near = solver.frames(
            slice(max(rows.start - 1, 0), min(rows.stop + 1, height)),
            slice(max(columns.start - 1, 0), min(columns.stop + 1, width)),
        )
        if not wanted[rows, columns].any():
            continue
        colour = torch.as_tensor(bayer_colours(near.bayer, *near.place()))
        operator = solver.model.operator(solver.trace(near), near.known("shading"), 0.0, solver.model.orders)
        y, weight = near.samples(range(lines.lines), lines)
        far = (near.known("column_px") - lines.centre_px(torch.arange(lines.lines)[:, None])).abs()
        root = (weight * (far > ZERO_ORDER_PX)).sqrt().T
        matrices = (operator.matrix_of(colour) * root[..., None]).numpy()
        values, shares = (y.T * root).numpy(), tile.shares()
        for at, row, column in zip(tile.flat, *tile.place(), strict=True):
            if not wanted[row, column]:
                continue
            own = [(0, 0, 1.0)]
            of_pixel = shares[:, row - rows.start, column - columns.start]
            own += [(*place, share) for place, share in zip(AROUND, of_pixel, strict=True)]
            parts = []
            for down, right, share in own:
                flat = (row + down) * width + column + right
                s = np.searchsorted(near.flat, flat)
                if share > 0 and s < len(near.flat) and near.flat[s] == flat:
                    lit = np.abs(matrices[s]).max(1) > 0
                    parts.append((share**0.5 * matrices[s, lit], share**0.5 * values[s, lit]))
            rows_, data = (np.concatenate(each).astype(float) for each in zip(*parts, strict=True))
            yield int(at), rows_, data


def scipy_solutions(
    solver: SpectralReconstruction, wanted: NDArray[np.bool_]
) -> dict[str, tuple[NDArray[np.float32], float]]:
    """Cubes (bands, rows, columns) of SciPy's solvers, and microseconds a pixel."""
    reported = solver.bands.reported
    bands = solver.bands.count
    smooth = np.diff(np.eye(bands), 2, axis=0) / solver.prior.taus[2]
    level = np.eye(bands) / solver.prior.level_std
    prior = np.vstack([smooth, level])
    believed = np.concatenate(
        [np.zeros(bands - 2), np.full(bands, solver.prior.level / solver.prior.level_std)]
    )
    names = ("scipy nnls, no prior", "scipy lsq_linear, smooth and bounded")
    cubes = {name: np.full((bands, *wanted.shape), np.nan, np.float32) for name in names}
    spent, count = dict.fromkeys(names, 0.0), 0
    for at, matrix, value in rows_of_pixels(solver, wanted):
        start = time.process_time()
        free = nnls(matrix, value, maxiter=30 * bands)[0]
        middle = time.process_time()
        held = lsq_linear(np.vstack([matrix, prior]), np.append(value, believed), solver.prior.bounds).x
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
    rig, truth = devices.calibration, truths.twin_truth(devices, grid)
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
        around = replace(pixels, valid=pixels.valid & binary_dilation(few.valid, np.ones((3, 3), bool)))
        others = scipy_solutions(SpectralReconstruction(*inputs, around, as_calibrated=True), few.valid)
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
