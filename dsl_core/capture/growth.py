"""The intensity graphs of a scan as they grow, coarse enough to keep all of them in memory."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsl_core.capture.preview import channels
from dsl_core.model.plan import CapturePlan, LineComb, ScanLines, Shot
from dsl_core.model.rig import BayerPattern

#: Memory that a scan's graphs may take, bytes.
BUDGET_BYTES = 128 << 20


@dataclass(frozen=True)
class IntensityGraph:
    """What a block of pixels saw of each pattern.

    ``position_px`` (patterns,) is where each pattern's first line begins on the projector; ``mean_dn``
    (settings, patterns, 3) are raw counts in R, G, B, NaN where no frame is there yet. The block is
    ``block_px`` wide and high and holds ``pixel``, ``(x, y)``.
    """

    pixel: tuple[int, int]
    block_px: int
    position_px: NDArray[np.float64]
    mean_dn: NDArray[np.float32]


class IntensityGraphs:
    """Collects spectral frames of a plan as block means."""

    def __init__(self, plan: CapturePlan, bayer: BayerPattern, budget_bytes: int = BUDGET_BYTES) -> None:
        """Blocks are as small as the budget allows, and hold whole cells of the mosaic."""
        self._plan, self._bayer = plan, bayer
        width, height = plan.camera_size_px
        count = len(plan.settings) * plan.spectral_count
        self.block_px = 2
        while _bytes(width, height, self.block_px, count) > budget_bytes:
            self.block_px += 2
        shape = (len(plan.settings), plan.spectral_count, 3, height // self.block_px, width // self.block_px)
        self._means = np.zeros(shape, np.float32)
        self._there = np.zeros(shape[:2], bool)

    def add(self, shot: Shot, pixels: NDArray[np.uint16]) -> None:
        """Take a frame; frames of other roles are left out."""
        if shot.role != "spectral":
            return
        cells = self.block_px // 2
        rows, columns = self._means.shape[-2:]
        for channel, values in enumerate(channels(pixels, self._bayer)):
            whole = values[: rows * cells, : columns * cells]
            # The sum over rows first: it runs along memory.
            sums = np.add.reduceat(whole, np.arange(0, rows * cells, cells), axis=0, dtype=np.float32)
            sums = np.add.reduceat(sums, np.arange(0, columns * cells, cells), axis=1)
            self._means[shot.setting, shot.pattern, channel] = sums / cells**2
        self._there[shot.setting, shot.pattern] = True

    def graph(self, pixel: tuple[int, int]) -> IntensityGraph | None:
        """The graph of the block around a pixel ``(x, y)``; None outside the image."""
        row, column = pixel[1] // self.block_px, pixel[0] // self.block_px
        rows, columns = self._means.shape[-2:]
        if not (0 <= row < rows and 0 <= column < columns) or self._means.shape[1] == 0:
            return None
        means = self._means[..., row, column].copy()
        means[~self._there] = np.nan
        return IntensityGraph(pixel, self.block_px, line_positions(self._plan), means)


def line_positions(plan: CapturePlan) -> NDArray[np.float64]:
    """Projector column at which each pattern's first line begins; its number where there are no lines."""
    step = plan.spectral.step_px if isinstance(plan.spectral, ScanLines | LineComb) else 1
    return np.arange(plan.spectral_count, dtype=np.float64) * step


def _bytes(width: int, height: int, block: int, count: int) -> int:
    return 3 * 4 * count * (width // block) * (height // block)
