"""Depth in an open box whose walls light each other, by Gray code, XOR code, and both as an ensemble.

Run ``python -m tests.benchmarks.bench_codes [--quick] [--json FILE]`` from the repository's root. Every code
sees the same scene of the twin with the published settings, first without lines, then refined on single
lines. All figures are of pixels that the projector lights: the share that got a depth, RMSE and outliers
(more than 5 mm off) among those, the share flagged because codes disagree, and seconds of capture (exposures
and latency) and of computing.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace

import numpy as np
import torch
from numpy.typing import NDArray

from dsl_core.model.plan import BinaryCode, CapturePlan, EnsembleCode, GrayCode, ScanLines, XorCode
from dsl_core.model.result import Flag
from dsl_core.model.rig import Rig
from dsl_core.patterns.images import pattern_image
from dsl_core.reconstruction.geometry import reconstruct_geometry
from dsl_core.reconstruction.merge import MergedScan, decode_columns, stack_lines
from dsl_core.simulation.effects.catalogue import USUAL, Choice
from dsl_core.simulation.published_rig import published_rig
from dsl_core.simulation.rendered_scene import EffectRequest, Setup
from dsl_core.simulation.rendering.renderer import Renderer
from dsl_core.simulation.scenes.catalogue import make_scene
from dsl_core.simulation.world import World
from tests.benchmarks.common import NoisyScan, options, print_table, write_json

SIZE_PX, QUICK_PX = (222, 145), (112, 73)
OUTLIER_MM = 5.0
LATENCY_MS = 50.0
LINES = ScanLines(step_px=4)
#: A plan has one spectral frame at least: white, which is taken anyway.
NO_LINES = ScanLines(width_px=640, step_px=640)
CODES: dict[str, BinaryCode] = {
    "Gray": GrayCode(rows=False),
    "XOR-02": XorCode(rows=False, base_px=2),
    "XOR-04": XorCode(rows=False, base_px=4),
    "Gray + XOR-02": EnsembleCode(rows=False, base_px=2),
    "Gray + XOR-04": EnsembleCode(rows=False, base_px=4),
}
Signal = NDArray[np.float32]


@dataclass(frozen=True)
class Row:
    """Figures of a code; shares are of lit pixels, of outliers of those with a depth."""

    scene: str
    code: str
    lines: bool
    frames: int
    with_depth: float
    rmse_mm: float
    median_mm: float
    outliers: float
    disagree: float
    capture_s: float
    compute_s: float


@dataclass(frozen=True)
class Rendered:
    """A scene without noise: frames by code or role, number and setting; depth; lit pixels."""

    frames: dict[tuple[str, int, int], Signal]
    depth_mm: NDArray[np.float64]
    lit: NDArray[np.bool_]


def plan_of(code: BinaryCode, size_px: tuple[int, int], lines: bool) -> CapturePlan:
    """A plan with a code, with or without lines, at the published settings."""
    spectral = LINES if lines else NO_LINES
    return CapturePlan(camera_size_px=size_px, code=code, spectral=spectral)


def render(world: World, size_px: tuple[int, int]) -> Rendered:
    """Every frame once; the noise comes later."""
    frames = {}
    for name in ("Gray", "XOR-02", "XOR-04"):
        plan = plan_of(CODES[name], size_px, name == "Gray")
        shots = [shot for shot in plan.shots() if name == "Gray" or shot.role == "code"]
        for shot in shots:
            world.show(pattern_image(plan, shot))
            place = (name if shot.role == "code" else shot.role, shot.pattern, shot.setting)
            frames[place] = world.rate() * np.float32(shot.exposure_ms)
    return Rendered(frames, world.truth.depth_mm, lit_pixels(world))


def lit_pixels(world: World) -> NDArray[np.bool_]:
    """Pixels whose zero order comes straight from inside the projector's frame."""
    plain = Renderer(world.rig, world.truth)
    lens = world.rig.projector
    column, row = plain.column.numpy(), plain.row.numpy()
    inside = (column > -0.5) & (column < lens.width_px - 0.5) & (row > -0.5) & (row < lens.height_px - 0.5)
    lit = np.zeros(world.truth.lit.size, bool)
    lit[plain.pixels.numpy()] = inside
    return np.asarray(lit.reshape(world.truth.lit.shape) & world.truth.lit)


def frames_of(rendered: Rendered, plan: CapturePlan, name: str, lines: bool) -> list[Signal]:
    """Frames in the order of a plan's shots."""
    kinds, count = name.split(" + "), CapturePlan(code=CODES["Gray"]).code_count
    found = []
    for shot in plan.shots():
        kind, number = str(shot.role), shot.pattern
        if shot.role == "code":
            kind, number = kinds[number // count], number % count
        elif shot.role == "spectral" and not lines:
            kind = "white"
        found.append(rendered.frames[kind, number, shot.setting])
    return found


def measure(rig: Rig, scene: str, rendered: Rendered, size_px: tuple[int, int]) -> Iterator[Row]:
    """A row for every code, without and with lines."""
    for lines in (False, True):
        for name, code in CODES.items():
            plan = plan_of(code, size_px, lines)
            source = NoisyScan(plan, frames_of(rendered, plan, name, lines), rig.sensor)
            started = time.process_time()
            scan = MergedScan(source, rig)
            decoded, white = decode_columns(scan)
            found = reconstruct_geometry(rig, plan, decoded, white, stack_lines(scan), refine_columns=lines)
            seconds = time.process_time() - started
            lit = rendered.lit
            error = (found.depth_mm - rendered.depth_mm)[lit]
            known = np.abs(error[np.isfinite(error)])
            yield Row(
                scene, name, lines, plan.shot_count, known.size / error.size,
                float(np.sqrt(np.mean(known**2))), float(np.median(known)),
                float(np.mean(known > OUTLIER_MM)),
                float(np.mean((found.flags[lit] & int(Flag.CODES_DISAGREE)) != 0)),
                plan.duration_s(LATENCY_MS), seconds,
            )  # fmt: skip


def cells(row: Row) -> list[str]:
    """A row as printed."""
    return [
        row.code, "yes" if row.lines else "no", str(row.frames), f"{row.with_depth:.2%}",
        f"{row.rmse_mm:.2f}", f"{row.median_mm:.3f}", f"{row.outliers:.3%}", f"{row.disagree:.2%}",
        f"{row.capture_s:.0f}", f"{row.compute_s:.1f}",
    ]  # fmt: skip


HEADER = (
    "code", "lines", "frames", "with depth", "RMSE mm", "median mm", "> 5 mm off", "disagree", "capture s",
    "compute s",
)  # fmt: skip


def main() -> None:
    """Print a table for each scene."""
    parser = options(__doc__)
    parser.add_argument("--effects", default="", help="choice of effects; default: usual and interreflection")
    chosen = parser.parse_args()
    torch.set_num_threads(1)
    size = QUICK_PX if chosen.quick else SIZE_PX
    effects = Choice.of(chosen.effects or ",".join((*USUAL, "interreflection")))
    rig = published_rig()
    rig = rig.model_copy(update={"camera": rig.camera.resized(*size)})
    rows: list[Row] = []
    for scene, kind in (("box", effects), ("box, walls dark to each other", replace(effects, names=USUAL))):
        world = World(Setup(rig), lambda z: make_scene("box"), request=EffectRequest(kind))
        found = list(measure(rig, scene, render(world, size), size))
        print(f"{scene}, {size[0]} x {size[1]} px")
        print_table(HEADER, [cells(row) for row in found])
        rows += found
    write_json(chosen.json, {"size_px": size, "rows": [asdict(row) for row in rows]})


if __name__ == "__main__":
    main()
