"""Scan lines and combs as one thing: equally spaced virtual lines, and the frame that shows each."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TypeVar

from torch import Tensor

from dsl_core.model.plan import CapturePlan, LineComb, ScanLines

Place = TypeVar("Place", float, Tensor)
#: Edges of a comb's lines that are farther apart leave pixels between them no slope that tells their column,
#: px: all of its patterns together do.
FARTHEST_EDGES_PX = 3


@dataclass(frozen=True)
class LineSet:
    """Virtual line ``i`` is centred on column ``first_px + step_px * i``, shown by frame ``i mod frames``."""

    width_px: int
    step_px: int
    first_px: float
    lines: int
    frames: int

    @classmethod
    def of(cls, plan: CapturePlan) -> LineSet | None:
        """The lines of a plan.

        None when its pattern set does not consist of equally spaced lines, and for combs of lines whose edges
        are so far apart that a line by itself does not tell a column.
        """
        width = plan.projector_size_px[0]
        match plan.spectral:
            case ScanLines(width_px=w, step_px=s):
                return cls(w, s, (w - 1) / 2, plan.spectral_count, plan.spectral_count)
            case LineComb(width_px=w, step_px=s, period_px=p, shifts_px=(0, 0, 0)) if p % s == 0:
                if max(w % s or s, -w % s) > FARTHEST_EDGES_PX:
                    return None
                return cls(w, s, (w - 1) / 2, -(-(width - w // 2) // s), p // s)
        return None

    @property
    def single(self) -> bool:
        """Whether every frame shows one line only."""
        return self.frames == self.lines

    def near(self, low_px: float, high_px: float) -> range:
        """Virtual lines centred between two columns, and the next one on either side."""
        first, last = self.position(low_px), self.position(high_px)
        return range(max(math.floor(first), 0), min(math.ceil(last) + 1, self.lines))

    def position(self, column_px: Place) -> Place:
        """Columns (px) in lines: virtual line ``i`` is at ``i``."""
        return (column_px - self.first_px) / self.step_px

    def nearest(self, column_px: Tensor) -> Tensor:
        """Virtual line nearest to columns (px), int64, not limited to the frame."""
        return self.position(column_px).round().long()

    def centre_px(self, line: Tensor) -> Tensor:
        """Column of the centre of virtual lines (px)."""
        return line * self.step_px + self.first_px

    def frame(self, line: Tensor) -> Tensor:
        """Frame that shows virtual lines; lines outside the projector are clamped (give them no weight)."""
        clamped = line.clip(0, self.lines - 1)
        return clamped if self.single else clamped % self.frames

    def exists(self, line: Tensor) -> Tensor:
        """Whether virtual lines are on the projector, bool."""
        return (line >= 0) & (line < self.lines)
