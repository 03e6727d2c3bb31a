"""Depth of a plane at 15 positions and six levels of noise: ordinary structured light against DSL.

Run ``python -m tests.benchmarks.bench_depth [--quick] [--json FILE]`` from the repository's root. The
whole field of view at 222 x 145 pixels; sigma is Gaussian noise as a share of full scale, on top of the
twin's shot and read noise. Three methods see the same scene:

- conventional: no film before the projector, binary code of 22 frames a setting;
- DSL coarse: with film, the same code, column not refined;
- DSL refined: with film, column refined on the 318 line frames.

RMSE is over lit pixels that got a depth; "depth" and "<= 1 mm" are shares of all lit pixels. Lit are
pixels whose zero order lies inside the projector's frame and not in shadow.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import NDArray

from dsl_core.evaluation.depth import DepthScore, depth_score
from dsl_core.model.plan import CapturePlan, GrayCode, ScanLines
from dsl_core.model.rig import Rig
from dsl_core.reconstruction.geometry import reconstruct_geometry
from dsl_core.reconstruction.merge import MergedScan, decode_columns, stack_lines
from dsl_core.simulation.published_rig import published_rig
from dsl_core.simulation.rendered_scene import Setup
from dsl_core.simulation.rendering.renderer import Renderer
from dsl_core.simulation.scenes.catalogue import make_scene
from dsl_core.simulation.world import World
from tests.benchmarks.common import NoisyScan, options, print_table, render_plan, with_noise, write_json

SIZE_PX = (222, 145)
POSITIONS_MM = tuple(float(z) for z in np.linspace(600, 900, 15))
SIGMAS = (0.0, 0.005, 0.01, 0.02, 0.03, 0.04)
CONVENTIONAL, COARSE, REFINED = METHODS = ("conventional", "DSL coarse", "DSL refined")
#: The goal: at this noise at most so many mm on at least that share of the lit pixels.
GOAL_SIGMA, GOAL_MM, GOAL_SHARE = 0.01, 1.0, 0.99

PLAN = CapturePlan(camera_size_px=SIZE_PX, code=GrayCode(rows=False))
#: Ordinary structured light has no use for lines; a plan has one spectral frame at least.
CODE_PLAN = PLAN.model_copy(update={"spectral": ScanLines(width_px=640, step_px=640)})


@dataclass(frozen=True)
class Position:
    """A plane at one position with and without film: expected frames and truth."""

    truth_mm: NDArray[np.float64]
    lit: NDArray[np.bool_]
    with_film: list[NDArray[np.float32]]
    without_film: list[NDArray[np.float32]]


def render(rig: Rig, position_mm: float) -> Position:
    """Render all patterns of a plane once; the noise comes later."""
    film, none = (
        World(Setup(rig, film=film), lambda z: make_scene("plane", depth_mm=z), position_mm=position_mm)
        for film in (True, False)
    )
    return Position(film.truth.depth_mm, lit(film), render_plan(film, PLAN), render_plan(none, CODE_PLAN))


def lit(world: World) -> NDArray[np.bool_]:
    """Pixels that the projector's centre sees and whose zero order comes from inside its frame."""
    renderer, projector = world.renderer, world.rig.projector
    assert isinstance(renderer, Renderer)
    inside = np.zeros(world.truth.lit.size, bool)
    column, row = renderer.column.numpy(), renderer.row.numpy()
    inside[renderer.pixels.numpy()] = (
        (column > -0.5)
        & (column < projector.width_px - 0.5)
        & (row > -0.5)
        & (row < projector.height_px - 0.5)
    )
    return inside.reshape(world.truth.lit.shape) & world.truth.lit


def depths(rig: Rig, position: Position, sigma: float) -> Iterator[tuple[str, NDArray[np.float64]]]:
    """Depth maps of the three methods at one noise level."""
    noisy = with_noise(rig, sigma)
    plain = MergedScan(NoisyScan(CODE_PLAN, position.without_film, noisy.sensor), noisy)
    code, white = decode_columns(plain)
    stack = stack_lines(plain)
    yield (
        CONVENTIONAL,
        reconstruct_geometry(noisy, CODE_PLAN, code, white, stack, refine_columns=False).depth_mm,
    )
    scan = MergedScan(NoisyScan(PLAN, position.with_film, noisy.sensor), noisy)
    code, white = decode_columns(scan)
    stack = stack_lines(scan)
    for method, refine in ((COARSE, False), (REFINED, True)):
        found = reconstruct_geometry(noisy, PLAN, code, white, stack, refine_columns=refine)
        yield method, found.depth_mm


def cells(score: DepthScore) -> list[str]:
    """RMSE and both shares, as printed."""
    return [f"{score.rmse_mm:.3f}", f"{score.coverage:.2%}", f"{score.within_1_mm:.2%}"]


def verdicts(rows: list[DepthRow]) -> list[str]:
    """The goal, and the comparison with ordinary structured light, over all rows."""
    at = {(row.method, row.position_mm, row.noise_sigma): row.score for row in rows}
    goal = [s for (m, _, sigma), s in at.items() if m == REFINED and sigma == GOAL_SIGMA]
    lines = []
    if goal:
        met = sum(s.rmse_mm <= GOAL_MM and s.coverage >= GOAL_SHARE for s in goal)
        lines.append(
            f"sigma {GOAL_SIGMA:g}: RMSE <= {GOAL_MM:g} mm on >= {GOAL_SHARE:.0%} of lit pixels at {met} of"
            f" {len(goal)} positions; largest RMSE {max(s.rmse_mm for s in goal):.3f} mm, least share"
            f" {min(s.coverage for s in goal):.2%}"
        )
    pairs = [(at[REFINED, z, sigma], at[CONVENTIONAL, z, sigma]) for m, z, sigma in at if m == REFINED]
    worse = sum(ours.rmse_mm > theirs.rmse_mm for ours, theirs in pairs)
    fewer = sum(ours.coverage < theirs.coverage for ours, theirs in pairs)
    less = sum(ours.within_1_mm < theirs.within_1_mm for ours, theirs in pairs)
    lines.append(
        f"refined against conventional, {len(pairs)} cells: RMSE larger in {worse}, fewer pixels with a depth"
        f" in {fewer}, fewer within 1 mm in {less}"
    )
    return lines


@dataclass(frozen=True)
class DepthRow:
    """The score of one method at one stage position and noise level (sigma as a share of full scale)."""

    method: str
    position_mm: float
    noise_sigma: float
    score: DepthScore


def main() -> None:
    """Print a row a position and noise level, then what the goals say."""
    parser = options(__doc__)
    arguments = parser.parse_args()
    positions = POSITIONS_MM[::7] if arguments.quick else POSITIONS_MM
    sigmas = (0.01, 0.04) if arguments.quick else SIGMAS
    rig = published_rig()
    rig = rig.model_copy(update={"camera": rig.camera.resized(*SIZE_PX)})
    columns = [f"{name}, {what}" for name in METHODS for what in ("RMSE mm", "depth", "<= 1 mm")]
    rows: list[DepthRow] = []
    for z in positions:
        position = render(rig, z)
        for sigma in sigmas:
            rows.extend(
                DepthRow(method, z, sigma, depth_score(depth, position.truth_mm, position.lit))
                for method, depth in depths(rig, position, sigma)
            )
    table = []
    for i in range(0, len(rows), len(METHODS)):
        group = rows[i : i + len(METHODS)]
        head = [f"{group[0].position_mm:.1f}", f"{group[0].noise_sigma:g}"]
        table.append(head + [cell for row in group for cell in cells(row.score)])
    print_table(["depth mm", "sigma", *columns], table)
    for line in verdicts(rows):
        print(line)
    write_json(arguments.json, {"size_px": SIZE_PX, "rows": [asdict(row) for row in rows]})


if __name__ == "__main__":
    main()
