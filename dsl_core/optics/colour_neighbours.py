"""Samples of a colour mosaic that belong to a pixel: its own and its neighbours' of the two other colours.

Bilinear demosaicing takes these samples, too, but averages them, although each of them sees another column of
the projector: where neighbours are several columns apart, no line has the profile of such a mean. Summed
normal equations take each sample where it is, with the weight that it has in the mean, as far as it is on the
pixel's own surface: the noise of dark samples is small, so that those beyond an edge would outweigh the
samples of a bright pixel.
"""

from __future__ import annotations

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from dsl_core.model.rig import BayerPattern
from dsl_core.optics.sensor import bayer_colours as bayer_colours

#: Where samples of other colours are around a pixel (rows, columns from it): at its sides, and its corners.
AROUND = ((0, -1), (0, 1), (-1, 0), (1, 0), (-1, -1), (-1, 1), (1, -1), (1, 1))
#: Contrast of two pixels of one colour, relative to their sum, at which they count half as the same surface.
HALF_CONTRAST = 0.05
#: Deviations of amplitudes that are no contrast.
NOISE = 3.0


def usual_shares(bayer: BayerPattern, rows: slice, columns: slice) -> NDArray[np.float64]:
    """How much samples `AROUND` the pixels of a part of a picture count, (8, rows, columns): all or nothing.

    A green pixel takes those at its sides, a red or blue one also those at its corners, one of a monochrome
    camera none.
    """
    shares = np.ones((8, rows.stop - rows.start, columns.stop - columns.start))
    if bayer == "MONO":
        return np.zeros_like(shares)
    shares[4:, bayer_colours(bayer, *np.mgrid[rows, columns]) == 1] = 0.0
    return shares


def shares_on_a_surface(
    usual: NDArray[np.float64], amplitude: NDArray[np.floating], std: NDArray[np.floating]
) -> NDArray[np.float64]:
    """Shares (8, rows, columns) of samples that are on the surface of their pixel.

    ``amplitude`` and its ``std`` have a margin of two pixels, NaN where there is none. Beyond a sample is
    always a pixel of the same colour as the own one: where that is much brighter or darker, an edge is in
    between. A colour all of whose samples are beyond an edge keeps them.
    """
    height, width = usual.shape[1:]
    own, own_std = amplitude[2:-2, 2:-2], std[2:-2, 2:-2]
    found = np.empty_like(usual)
    for share, (y, x) in zip(found, AROUND, strict=True):
        far = np.s_[2 + 2 * y : 2 + 2 * y + height, 2 + 2 * x : 2 + 2 * x + width]
        noise = NOISE * np.hypot(own_std, std[far])
        apart = np.abs(own - amplitude[far])
        both = np.abs(own) + np.abs(amplitude[far]) + noise
        contrast = np.divide((apart - noise).clip(0), both, out=np.zeros_like(both), where=both > 0)
        share[:] = 1 / (1 + (np.nan_to_num(contrast) / HALF_CONTRAST) ** 4)
    is_green = usual[4] == 0
    best = found[:4].max(0)
    for pair in (slice(0, 2), slice(2, 4)):
        found[pair] /= np.where(is_green, found[pair].max(0), best)
    found[4:] /= found[4:].max(0)
    return found * usual


class ColourNeighbours:
    """Sums of values over the samples that belong to each pixel of a tile."""

    def __init__(
        self,
        rows: slice,
        columns: slice,
        samples: tuple[NDArray[np.intp], NDArray[np.intp]],
        pixels: tuple[NDArray[np.intp], NDArray[np.intp]],
        shares: NDArray[np.float64],
    ) -> None:
        """``samples`` and ``pixels`` are rows and columns in the picture of what is given and wanted.

        Pixels are inside the tile of ``rows`` and ``columns``, samples may be up to one pixel outside it;
        ``shares`` (8, rows, columns) say how much of those `AROUND` a pixel count.
        """
        self._height, self._width = rows.stop - rows.start + 2, columns.stop - columns.start + 2
        y, x = (at - part.start + 1 for at, part in zip(samples, (rows, columns), strict=True))
        self._samples = torch.as_tensor(y * self._width + x)
        y, x = (at - part.start for at, part in zip(pixels, (rows, columns), strict=True))
        self._pixels = torch.as_tensor(y * (self._width - 2) + x)
        self._shares = torch.as_tensor(shares)

    def sum(self, values: Tensor) -> Tensor:
        """Sums over own and neighbouring samples, (..., samples) -> (..., pixels)."""
        grid = values.new_zeros((*values.shape[:-1], self._height * self._width))
        grid[..., self._samples.to(values.device)] = values
        grid = grid.reshape(*values.shape[:-1], self._height, self._width)
        height, width = self._height - 2, self._width - 2
        total = grid[..., 1:-1, 1:-1].clone()
        for share, (y, x) in zip(self._shares.to(values), AROUND, strict=True):
            total += share * grid[..., 1 + y : 1 + y + height, 1 + x : 1 + x + width]
        return total.flatten(-2).index_select(-1, self._pixels.to(values.device))
