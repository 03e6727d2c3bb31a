"""Lines that change frames in an order of their own: what combs light together, these keep apart.

The frame is divided into slots ``step_px`` apart, each lit by a line of one frame. A comb goes through its
frames in the same order over and over, so that two wavelengths a period apart are in each other's way in all
frames. Here every run of as many slots as there are frames holds each frame once, in an order drawn anew:
two wavelengths meet in a few frames only. White lines, as the zero order of any LED spoils all channels.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil

import numpy as np
from numpy.typing import NDArray

from dsl_core.errors import PlanError

#: Dark columns between the lines of a frame, at least: nearer ones act as one wide line.
DARK_PX = 4
#: Draws of an order before a run counts as impossible.
TRIES = 2000


@dataclass(frozen=True)
class MixedLines:
    """Lines ``width_px`` wide, ``step_px`` apart, in the order of a seed."""

    frames: int
    width_px: int
    step_px: int
    seed: int

    @property
    def name(self) -> str:
        """How people call it."""
        return f"mixed lines {self.width_px}x{self.step_px}x{self.frames}, order {self.seed}"

    def order(self, slots: int) -> NDArray[np.int64]:
        """Frame of each slot; raises `PlanError` where the lines of a frame cannot keep apart."""
        gap = ceil((self.width_px + DARK_PX) / self.step_px) - 1
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
            f"Lines of {self.width_px} columns in steps of {self.step_px} do not keep apart in"
            f" {self.frames} frames. Ask for more frames or narrower lines."
        )

    def levels(self, width_px: int) -> NDArray[np.uint8]:
        """Drive levels (frames, width, 3) for a projector; raises `PlanError`."""
        levels = np.zeros((self.frames, width_px, 3), np.uint8)
        for slot, frame in enumerate(self.order(ceil(width_px / self.step_px))):
            start = slot * self.step_px
            levels[frame, start : start + self.width_px] = 255
        return levels
