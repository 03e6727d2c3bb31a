"""Pattern sets by design: the lines and their order that a rig's own model expects the least error of.

Candidates are lines of some widths and steps that take frames in an order of their own; a `Judge` says what
is expected of each.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import cast

import numpy as np
import torch
from numpy.typing import NDArray

from dsl_core.errors import PlanError
from dsl_core.model.plan import CapturePlan, Columns, LineComb, SpectralSet
from dsl_core.model.rig import Rig
from dsl_core.model.spectral import WavelengthGrid
from dsl_core.optics.correspondence import correspondence
from dsl_core.planning.judge import Judge
from dsl_core.planning.mixed_lines import MixedLines
from dsl_core.progress import NoProgress, Progress

#: Runs of slots, as shares of the columns that a first order's spectrum covers, and widths of lines (px).
RUNS, WIDTHS_PX = (0.5, 0.62, 0.75), (5, 6, 7, 9, 11)
SPECTRUM_NM = (430.0, 690.0)
#: How many kinds of lines are tried in further orders.
FINALISTS = 3


@dataclass(frozen=True)
class Design:
    """The set chosen, and the expected errors of it and of the best comb of as many frames."""

    lines: MixedLines
    levels: NDArray[np.uint8]
    error: float
    comb: LineComb
    comb_error: float

    @property
    def columns(self) -> Columns:
        """The set as it stands in a plan."""
        return columns_of(self.levels)


def columns_of(levels: NDArray[np.uint8]) -> Columns:
    """Drive levels (frames, width, 3), 0 to 255, as a pattern set."""
    shares = np.round(levels / 255.0, 5)
    return Columns(levels=tuple(tuple(tuple(rgb) for rgb in frame) for frame in shares.tolist()))


def design(
    rig: Rig,
    plan: CapturePlan,
    frames: int,
    *,
    grid: WavelengthGrid | None = None,
    orders: int = 24,
    progress: Progress | None = None,
) -> Design:
    """Search ``frames`` patterns for a rig and the settings of a plan; raises `PlanError`.

    Every kind of line is tried in one order, the best ones in ``orders`` of them. The answer depends on the
    rig, the settings and the numbers alone.
    """
    if not 8 <= frames <= 160:
        raise PlanError(f"A set of {frames} patterns cannot be designed; choose 8 to 160.")
    if orders < 1:
        raise PlanError(f"A design needs at least one order of its lines, not {orders}.")
    progress, judge = progress or NoProgress(), Judge(rig, plan, grid)
    kinds, combs = list(_kinds(rig, frames)), list(_combs(rig, frames))
    if not kinds:
        raise PlanError(f"No lines of {frames} patterns fit the projector of rig {rig.name!r}. Ask for more.")
    total = len(combs) + len(kinds) + FINALISTS * (orders - 1)
    count = iter(range(1, total + 1))

    def judged(sets: Iterable[LineComb | MixedLines]) -> list[tuple[float, LineComb | MixedLines]]:
        found = []
        for each in sets:
            found.append((judge.error(_spectral(each, rig)), each))
            progress.report("design", next(count), total)
        return sorted(found, key=lambda pair: pair[0])

    comb_error, comb = judged(combs)[0]
    first = judged(kinds)
    more = [
        replace(cast(MixedLines, kind), seed=seed)
        for _, kind in first[:FINALISTS]
        for seed in range(2, orders + 1)
    ]
    error, lines = min([first[0], *judged(more)], key=lambda pair: pair[0])
    chosen = cast(MixedLines, lines)
    return Design(chosen, chosen.levels(rig.projector.width_px), error, cast(LineComb, comb), comb_error)


def _spectral(each: LineComb | MixedLines, rig: Rig) -> SpectralSet:
    return each if isinstance(each, LineComb) else columns_of(each.levels(rig.projector.width_px))


def _steps(rig: Rig, frames: int) -> list[int]:
    """Steps of lines (px), at least one: runs as long as a part of a first order's spectrum."""
    pixel = torch.tensor([int(rig.camera.cy_px) * rig.camera.width_px + int(rig.camera.cx_px)])
    depth = torch.tensor([sum(rig.depth_range_mm) / 2], dtype=torch.float64)
    columns = correspondence(rig).trace(pixel, depth, 1, np.array(SPECTRUM_NM)).columns
    span = abs(float(columns[1, 0] - columns[0, 0]))
    return sorted({max(round(share * span / frames), 1) for share in RUNS})


def _kinds(rig: Rig, frames: int) -> Iterator[MixedLines]:
    for step in _steps(rig, frames):
        for width in WIDTHS_PX:
            lines = MixedLines(frames, width, step, 1)
            if step < width:
                try:
                    lines.order(3 * frames)
                except PlanError:
                    continue
                yield lines


def _combs(rig: Rig, frames: int) -> Iterator[LineComb]:
    """Combs of as many frames, in the steps of mixed lines."""
    for step in _steps(rig, frames):
        for width in WIDTHS_PX:
            if step < width < step * frames:
                yield LineComb(width_px=width, step_px=step, period_px=step * frames)
