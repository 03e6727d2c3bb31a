"""Captures against error: how many positions, filters and lines the depth stage really needs.

Run ``python -m tests.benchmarks.bench_stage_captures [--quick]``. Planes at five positions are seen through
seven filters under lines 2 px apart, as published; then parts of it are used. Errors are those of
first-order columns (px, rms) against the truth, at random pixels, depths of 550 to 950 mm and bands of 430 to
660 nm; geometry is the true one, so that nothing but the correspondence is compared.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
import torch

from dsl_core.calibration.film.correspondence import fit_stage_grid
from dsl_core.calibration.film.depth_stage import StageData, StageFilter, fit_first_orders
from dsl_core.calibration.film.order_paths import LineFrames
from dsl_core.calibration.film.order_samples import OrderSamples
from dsl_core.calibration.film.residual import choose_residual
from dsl_core.campaign.depth_stage.planes import lines_on_plane
from dsl_core.errors import CalibrationError
from dsl_core.model.plan import CapturePlan, NoCode, ScanLines, Setting
from dsl_core.model.rig import Film, Rig
from dsl_core.optics.correspondence import Correspondence, GratingModel, correspondence, zero_order
from dsl_core.optics.shading import Plane
from dsl_core.progress import NoProgress
from dsl_core.simulation.bandpass_filters import measured_transmissions, true_transmission
from dsl_core.simulation.published_rig import published_rig
from dsl_core.simulation.random_rig import random_rig
from dsl_core.simulation.rendered_scene import Setup
from dsl_core.simulation.scenes.catalogue import make_scene
from dsl_core.simulation.world import World
from tests.benchmarks.common import NoisyScan, options, print_table, render_plan, write_json

SIZE = (112, 72)
POSITIONS_MM = (600.0, 675.0, 750.0, 825.0, 900.0)
FILTERS_NM = (440.0, 470.0, 500.0, 540.0, 580.0, 610.0, 640.0)
STEP_PX = 2
#: Frames of the code that a position needs beside its lines, as published: 40.
CODE_FRAMES, PUBLISHED = 40, 5 * 7 * (40 + 318)
SETTING = Setting(exposure_ms=1000.0, level=1.0)
#: Indices of the positions and filters used when there are so many.
SOME_POSITIONS = {2: (0, 4), 3: (0, 2, 4), 5: (0, 1, 2, 3, 4)}
SOME_FILTERS = {1: (3,), 2: (1, 5), 3: (1, 3, 6), 5: (0, 2, 3, 5, 6), 7: (0, 1, 2, 3, 4, 5, 6)}
STEPS_PX = (2, 4, 8, 16, 32)


@dataclass(frozen=True)
class Row:
    """One choice, its frames as the published count goes, and the errors of three models, px."""

    positions: int
    filters: int
    step_px: int
    frames: int
    grating_px: float
    hybrid_px: float
    grid_px: float


def captures(rig: Rig, positions: Sequence[int], filters: Sequence[int]) -> dict[tuple[int, int], LineFrames]:
    """Lines on the plane at every position through every filter, with noise."""
    plan = CapturePlan(
        camera_size_px=SIZE,
        code=NoCode(),
        spectral=ScanLines(step_px=STEP_PX),
        settings=(SETTING,),
        code_settings=(0,),
    )
    found = {}
    for k, f in product(positions, filters):
        world = World(Setup(rig), lambda mm: make_scene("plane", depth_mm=mm), POSITIONS_MM[k])
        world.insert(True, true_transmission(FILTERS_NM[f]))
        scan = NoisyScan(plan, render_plan(world, plan), rig.sensor, seed=100 * k + f)
        found[k, f] = lines_on_plane(scan, rig)
    return found


def thinned(frames: LineFrames, step_px: int) -> LineFrames:
    """The frames of lines that lie farther apart."""
    part = slice(None, None, step_px // STEP_PX)
    lines = frames.lines.model_copy(update={"step_px": step_px, "sparse": True})
    return LineFrames(lines, frames.pixels, frames.radiance[part], frames.std[part])


def error_px(model: Correspondence, truth: Rig) -> float:
    """Root mean square over random pixels, depths and bands that are lit."""
    rng = np.random.default_rng(11)
    pixels = torch.as_tensor(rng.integers(0, SIZE[0] * SIZE[1], 4000))
    depth = torch.as_tensor(rng.uniform(550, 950, 4000))
    column, row = zero_order(truth, pixels, depth)
    lit = (column > 0) & (column < 639) & (row > 0) & (row < 359)
    nm, off = np.arange(430.0, 661.0, 5.0), []
    for order in (1, -1):
        exact = GratingModel(truth).exact(pixels, depth, order, nm)
        inside = exact.inside(640, 360) & lit
        off.append((model.trace(pixels, depth, order, nm).columns - exact.columns)[inside])
    return float(torch.cat(off).square().mean().sqrt())


def row(
    truth: Rig,
    seen: dict[tuple[int, int], LineFrames],
    positions: Sequence[int],
    filters: Sequence[int],
    step_px: int,
) -> Row:
    """Calibrate from a part of the captures."""
    curves = measured_transmissions()
    data = StageData(
        positions_mm=tuple(POSITIONS_MM[k] for k in positions),
        stage_std_mm=0.02,
        columns=(),
        filters=tuple(StageFilter(FILTERS_NM[f], curves[FILTERS_NM[f]], True) for f in filters),
        frames=lambda k, f: thinned(seen[positions[k], filters[f]], step_px),
        exposures=0,
    )
    planes = [Plane(np.array([0.0, 0.0, 1 / z])) for z in data.positions_mm]
    mounted = truth.model_copy(update={"film": Film()})
    film, samples = fit_first_orders(mounted, planes, data, NoProgress())
    fitted = truth.model_copy(update={"film": film.film})
    names = [str(i) for i in range(7)]
    residual, _ = choose_residual(fitted, samples, names, names)
    lines = (640 - 5) // step_px + 1
    return Row(
        len(positions),
        len(filters),
        step_px,
        len(positions) * (CODE_FRAMES + len(filters) * lines),
        error_px(GratingModel(fitted), truth),
        error_px(correspondence(fitted.model_copy(update={"residual": residual})), truth),
        _grid_error_px(fitted, samples, truth),
    )


def _grid_error_px(fitted: Rig, samples: OrderSamples, truth: Rig) -> float:
    """Error of the published model; not a number where positions or filters do not suffice for it."""
    try:
        grid = fit_stage_grid(fitted, samples).grid
    except CalibrationError:
        return float("nan")
    return error_px(correspondence(truth.model_copy(update={"correspondence": grid}), "grid"), truth)


def main() -> None:
    """Print the table."""
    arguments = options(__doc__)
    chosen = arguments.parse_args()
    rig = published_rig()
    truth = random_rig(1, rig.model_copy(update={"camera": rig.camera.resized(*SIZE)}))
    counts = (2, 3) if chosen.quick else tuple(SOME_POSITIONS)
    filters = (1, 3) if chosen.quick else tuple(SOME_FILTERS)
    seen = captures(truth, SOME_POSITIONS[max(counts)], SOME_FILTERS[max(filters)])
    rows = [
        row(truth, seen, SOME_POSITIONS[p], SOME_FILTERS[f], step)
        for p, f, step in product(counts, filters, (4, 32) if chosen.quick else STEPS_PX)
        if set(SOME_FILTERS[f]) <= set(SOME_FILTERS[max(filters)])
    ]
    print_table(
        ("positions", "filters", "step px", "frames", "of published", "grating px", "hybrid px", "grid px"),
        [
            (r.positions, r.filters, r.step_px, r.frames, f"{r.frames / PUBLISHED:.1%}",
             f"{r.grating_px:.4f}", f"{r.hybrid_px:.4f}", f"{r.grid_px:.3f}")
            for r in rows
        ],
    )  # fmt: skip
    write_json(chosen.json, {"rows": [vars(r) for r in rows]})


if __name__ == "__main__":
    main()
