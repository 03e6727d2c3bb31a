"""The samples of a mosaic that belong to a pixel are those that bilinear demosaicing takes."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from dsl_core.model.rig import BayerPattern
from dsl_core.optics.colour_neighbours import ColourNeighbours, bayer_colours
from dsl_core.optics.demosaic import demosaic_variance

SHAPE = (9, 12)


@pytest.mark.parametrize("bayer", ["RGGB", "GRBG", "BGGR", "GBRG"])
@pytest.mark.parametrize("tile", [(slice(2, 7), slice(3, 9)), (slice(0, 4), slice(7, 12))])
def test_sums_of_information_are_those_of_demosaicing(bayer: BayerPattern, tile: tuple[slice, slice]) -> None:
    information = np.ones(SHAPE)
    near = tuple(slice(max(p.start - 1, 0), min(p.stop + 1, n)) for p, n in zip(tile, SHAPE, strict=True))
    samples, pixels = (tuple(grid.ravel() for grid in np.mgrid[part]) for part in (near, tile))
    values = torch.as_tensor(information[samples])
    found = ColourNeighbours(bayer, *tile, samples, pixels).sum(values)
    # Away from the picture's edge, where demosaicing repeats samples.
    inside = np.all([(at > 0) & (at < n - 1) for at, n in zip(pixels, SHAPE, strict=True)], axis=0)
    wanted = (1 / demosaic_variance(np.ones(SHAPE), bayer)).sum(0)[pixels]
    np.testing.assert_allclose(found.numpy()[inside], wanted[inside])
    # A sample that is not there is missing where it belonged, and nowhere else.
    y, x = 4, 8
    kept = (samples[0] != y) | (samples[1] != x)
    without = ColourNeighbours(bayer, *tile, tuple(at[kept] for at in samples), pixels).sum(values[kept])
    colours = bayer_colours(bayer, *np.mgrid[: SHAPE[0], : SHAPE[1]])
    for py, px, lost in zip(*pixels, (found - without).tolist(), strict=True):
        close = max(abs(py - y), abs(px - x)) <= 1
        uses = close and ((py, px) == (y, x) or colours[py, px] != colours[y, x])
        assert lost == float(uses), (py, px)


def test_a_monochrome_pixel_has_no_sample_but_its_own() -> None:
    samples, pixels = (
        tuple(grid.ravel() for grid in np.mgrid[part]) for part in ((slice(0, 5),) * 2, (slice(1, 4),) * 2)
    )
    values = torch.arange(25.0)
    found = ColourNeighbours("MONO", slice(1, 4), slice(1, 4), samples, pixels).sum(values)
    np.testing.assert_array_equal(found.numpy(), values.reshape(5, 5)[1:4, 1:4].ravel())
