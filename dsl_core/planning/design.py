"""Pattern sets by design: the lines and their order that a rig's own model expects the least error of.

Candidates are lines of some widths and steps that change frames in an order of their own; a `Judge` says what
is expected of each. What combs light together, these lines keep apart: the frame is divided into slots
``step_px`` apart, each lit by a line of one frame. A comb repeats its frames in the same order, so that two
wavelengths a period apart overlap in all frames. Here every run of as many slots as there are frames holds
each frame once, in an order drawn again for each run: two wavelengths meet in a few frames only. The lines
are white, as the zero order of any LED spoils all channels.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from math import ceil
from typing import cast

import numpy as np
import torch
from numpy.typing import NDArray

from dsl_core.errors import PlanError
from dsl_core.model.plan import CapturePlan, Columns, LineComb, SpectralSet
from dsl_core.model.presets import column_scale
from dsl_core.model.rig import Rig
from dsl_core.model.spectral import WavelengthGrid
from dsl_core.optics.correspondence import correspondence
from dsl_core.planning.designed import columns_of
from dsl_core.planning.judge import Judge
from dsl_core.progress import NoProgress, Progress

#: Runs of slots, as shares of the columns that a first order's spectrum covers, and widths of lines of the
#: published projector (px).
RUNS, WIDTHS_PX = (0.5, 0.62, 0.75), (5, 6, 7, 9, 11)
SPECTRUM_NM = (430.0, 690.0)
#: How many kinds of lines are tried in further orders.
FINALISTS = 3
#: Dark columns between the lines of a frame, at least, of the published projector: nearer ones act as one
#: wide line.
DARK_PX = 4
#: Draws of an order before a run counts as impossible.
TRIES = 2000


@dataclass(frozen=True)
class MixedLines:
    """Lines ``width_px`` wide, ``step_px`` apart, in the order of a seed.

    Between the lines of a frame at least ``dark_px`` are dark.
    """

    frames: int
    width_px: int
    step_px: int
    seed: int
    dark_px: int = DARK_PX

    @property
    def name(self) -> str:
        """How people call it."""
        return f"mixed lines {self.width_px}x{self.step_px}x{self.frames}, order {self.seed}"

    def order(self, slots: int) -> NDArray[np.int64]:
        """Frame of each slot; raises `PlanError` where the lines of a frame cannot keep apart."""
        gap = ceil((self.width_px + self.dark_px) / self.step_px) - 1
        random = np.random.Generator(np.random.PCG64(self.seed))
        found: list[int] = []
        while len(found) < slots:
            found += self._run(found, gap, random)
        return np.array(found[:slots])

    def _run(self, before: list[int], gap: int, random: np.random.Generator) -> list[int]:
        """Every frame once, none within ``gap`` slots of its last line."""
        for _ in range(TRIES):
            left, run = random.permutation(self.frames).tolist(), list[int]()
            while left:
                recent = set((before + run)[-gap:]) if gap else set()
                free = [frame for frame in left if frame not in recent]
                if not free:
                    break
                left.remove(free[0])
                run.append(free[0])
            if not left:
                return run
        raise PlanError(
            f"Lines of {self.width_px} columns in steps of {self.step_px} cannot be kept apart in"
            f" {self.frames} frames. Use more frames or narrower lines."
        )

    def levels(self, width_px: int) -> NDArray[np.uint8]:
        """Drive levels (frames, width, 3) for a projector; raises `PlanError`."""
        levels = np.zeros((self.frames, width_px, 3), np.uint8)
        for slot, frame in enumerate(self.order(ceil(width_px / self.step_px))):
            start = slot * self.step_px
            levels[frame, start : start + self.width_px] = 255
        return levels


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
        raise PlanError(
            f"No lines of {frames} patterns fit the projector of rig {rig.name!r}. Use more patterns."
        )
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


def _widths(rig: Rig) -> list[int]:
    """Widths of lines on a rig's projector, px."""
    return [round(width * column_scale(rig.projector.width_px)) for width in WIDTHS_PX]


def _kinds(rig: Rig, frames: int) -> Iterator[MixedLines]:
    dark_px = round(DARK_PX * column_scale(rig.projector.width_px))
    for step in _steps(rig, frames):
        for width in _widths(rig):
            lines = MixedLines(frames, width, step, 1, dark_px)
            if step < width:
                try:
                    lines.order(3 * frames)
                except PlanError:
                    continue
                yield lines


def _combs(rig: Rig, frames: int) -> Iterator[LineComb]:
    """Combs of as many frames, in the steps of mixed lines."""
    for step in _steps(rig, frames):
        for width in _widths(rig):
            if step < width < step * frames:
                yield LineComb(width_px=width, step_px=step, period_px=step * frames)
