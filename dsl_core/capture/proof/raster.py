"""A part of every picture that is cheap to compare: whole rows, spread evenly over the height.

Rows instead of the means of blocks, because the finest stripes of a code average away in a block; and whole
ones, because a line lights only a few pixels of each.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.rig import colour_sites
from dsl_core.solve.thinned import spread_rows

Floats = NDArray[np.float32]
Counts = NDArray[np.uint16]
#: Rows of a large picture, and the pixels up to which a small one may have more.
_ROWS, _PIXELS = 36, 32_000
#: Pixels of a row at most; wider pictures are thinned.
_WIDTH = 1024
#: This row is always among them: of the colours of the first one, and lit as that is.
BESIDE = 2
#: Blocks down and across that stand in for pixels where these are too noisy.
BLOCKS = 16


class Raster:
    """Which pixels of a picture are compared: flat arrays, row after row."""

    def __init__(self, size_px: tuple[int, int]) -> None:
        """For pictures of ``size_px`` = (width, height)."""
        width, height = size_px
        count = min(height, max(_ROWS, _PIXELS // width))
        #: Rows of the picture, in their order.
        self.rows = spread_rows(height, count)
        if height > count:
            self.rows = np.unique([*spread_rows(height, count - 1), BESIDE])
        #: Columns of the picture from one of the raster to the next: an even number would miss a colour.
        self.step_px = -(-width // _WIDTH) | 1
        #: How many times as far apart its rows are as its columns.
        self.rows_px = (height / self.rows.size) / self.step_px
        #: Rows and columns of the raster.
        self.shape = (self.rows.size, -(-width // self.step_px))
        self._mosaic = (self.rows[:, None] % 2) * 2 + np.arange(0, width, self.step_px)[None, :] % 2

    def take(self, pixels: NDArray[np.uint16]) -> Counts:
        """The compared pixels of a raw mosaic (rows, columns), flat and not to be changed."""
        taken = np.ascontiguousarray(pixels[self.rows, :: self.step_px]).ravel()
        taken.flags.writeable = False
        return taken

    def pool(self, values: Counts | Floats) -> Floats:
        """Means over blocks of the raster, `BLOCKS` of them down and across, flat."""
        down, across = self._block
        rows, columns = self.shape[0] // down, self.shape[1] // across
        whole = values.reshape(self.shape)[: rows * down, : columns * across]
        sums = whole.reshape(rows, down, -1).sum(1, dtype=np.float32)
        return np.asarray(sums.reshape(rows * columns, across).sum(1) / np.float32(down * across))

    @property
    def pooled(self) -> int:
        """Pixels of a block."""
        down, across = self._block
        return down * across

    @property
    def _block(self) -> tuple[int, int]:
        return max(self.shape[0] // BLOCKS, 1), max(self.shape[1] // BLOCKS, 1)

    def channels(self, bayer: str) -> NDArray[np.int8]:
        """Channel of every compared pixel, flat: 0 red, 1 green, 2 blue."""
        table = np.array(colour_sites(bayer), np.int8)
        return np.asarray(table[self._mosaic].ravel())
