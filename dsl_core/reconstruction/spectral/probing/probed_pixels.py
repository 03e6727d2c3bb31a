"""Which pixels of a picture are probed, and which samples of the mosaic belong to them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.rig import BayerPattern
from dsl_core.optics.colour_neighbours import bayer_colours

Indices = NDArray[np.intp]

#: Cells (rows, columns) that the picture is divided into.
CELLS = (6, 8)


def sample_pixels(valid: NDArray[np.bool_], per_cell: int) -> Indices:
    """Flat indices of up to ``per_cell`` pixels of each cell whose eight neighbours are valid, too."""
    from scipy.ndimage import minimum_filter

    inner = np.flatnonzero(minimum_filter(valid.astype(np.uint8), 3, mode="constant"))
    inner = np.random.default_rng(0).permutation(inner)
    cell = cell_of(*np.divmod(inner, valid.shape[1]), valid.shape).astype(np.uint8)
    order = np.argsort(cell, kind="stable")
    first = np.searchsorted(cell[order], cell[order])
    return np.sort(inner[order[np.arange(len(order)) - first < per_cell]])


def cell_of(rows: Indices, columns: Indices, shape: tuple[int, ...]) -> Indices:
    """Index of the cell of pixels in a picture of a shape."""
    return np.asarray(rows * CELLS[0] // shape[0] * CELLS[1] + columns * CELLS[1] // shape[1], np.intp)


def samples_of(targets: Indices, shape: tuple[int, ...], bayer: BayerPattern) -> tuple[Indices, Indices]:
    """Flat indices of the samples that belong to inner targets, and the number of each one's target."""
    y, x = np.divmod(targets, shape[1])
    colour = bayer_colours(bayer, y, x)
    samples, owner = [], []
    for dy in (-1, 0, 1):
        for dx in (-1, 0, 1):
            other = bayer_colours(bayer, y + dy, x + dx)
            use = np.flatnonzero((other != colour) | (dy == dx == 0))
            samples.append((y[use] + dy) * shape[1] + x[use] + dx)
            owner.append(use)
    return np.concatenate(samples), np.concatenate(owner)
