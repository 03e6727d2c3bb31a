"""Samples of a colour mosaic that belong to a pixel: its own and its neighbours' of the two other colours.

Bilinear demosaicing takes these samples, too, but averages them, although each of them sees another column of
the projector: where neighbours are several columns apart, no line has the profile of such a mean. Summed
normal equations take each sample where it is, with the weight that it has in the mean.
"""

from __future__ import annotations

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from dsl_core.model.rig import BayerPattern, colour_sites


def bayer_colours(bayer: BayerPattern, rows: NDArray[np.intp], columns: NDArray[np.intp]) -> NDArray[np.intp]:
    """Colour, 0 to 2 for red, green and blue, of pixels at rows and columns of the picture."""
    sites = np.array(colour_sites(bayer)).reshape(2, 2)
    return np.asarray(sites[rows % 2, columns % 2], np.intp)


class ColourNeighbours:
    """Sums of values over the samples that belong to each pixel of a tile."""

    def __init__(
        self,
        bayer: BayerPattern,
        rows: slice,
        columns: slice,
        samples: tuple[NDArray[np.intp], NDArray[np.intp]],
        pixels: tuple[NDArray[np.intp], NDArray[np.intp]],
    ) -> None:
        """``samples`` and ``pixels`` are rows and columns in the picture of what is given and wanted.

        Pixels are inside the tile of ``rows`` and ``columns``, samples may be up to one pixel outside it.
        """
        self._height, self._width = rows.stop - rows.start + 2, columns.stop - columns.start + 2
        y, x = (at - part.start + 1 for at, part in zip(samples, (rows, columns), strict=True))
        self._samples = torch.as_tensor(y * self._width + x)
        y, x = (at - part.start for at, part in zip(pixels, (rows, columns), strict=True))
        self._pixels = torch.as_tensor(y * (self._width - 2) + x)
        self._is_mono = bayer == "MONO"
        inner = np.mgrid[rows.start : rows.stop, columns.start : columns.stop]
        self._green = torch.as_tensor(bayer_colours(bayer, *inner) == 1)

    def sum(self, values: Tensor) -> Tensor:
        """Sums over own and neighbouring samples, (..., samples) -> (..., pixels).

        A green pixel takes those beside, above and below it, a red or blue one also those at its corners,
        one of a monochrome camera none.
        """
        grid = values.new_zeros((*values.shape[:-1], self._height * self._width))
        grid[..., self._samples.to(values.device)] = values
        grid = grid.reshape(*values.shape[:-1], self._height, self._width)
        if self._is_mono:
            own = grid[..., 1:-1, 1:-1].flatten(-2)
            return own.index_select(-1, self._pixels.to(values.device))
        rows = grid[..., 1:-1] + grid[..., :-2]
        rows += grid[..., 2:]
        green = self._green.to(values.device)
        total = rows[..., 1:-1, :].clone()
        for near in (slice(None, -2), slice(2, None)):
            total += torch.where(green, grid[..., near, 1:-1], rows[..., near, :])
        return total.flatten(-2).index_select(-1, self._pixels.to(values.device))
