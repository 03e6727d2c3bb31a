"""The samples of a mosaic that belong to a pixel are those that bilinear demosaicing takes."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from dsl_core.model.rig import BayerPattern
from dsl_core.optics.colour_neighbours import (
    AROUND,
    ColourNeighbours,
    bayer_colours,
    shares_on_a_surface,
    usual_shares,
)
from dsl_core.optics.demosaic import demosaic_variance

SHAPE = (9, 12)


@pytest.mark.parametrize("bayer", ["RGGB", "GRBG", "BGGR", "GBRG"])
@pytest.mark.parametrize("tile", [(slice(2, 7), slice(3, 9)), (slice(0, 4), slice(7, 12))])
def test_sums_of_information_are_those_of_demosaicing(bayer: BayerPattern, tile: tuple[slice, slice]) -> None:
    information = np.ones(SHAPE)
    near = tuple(slice(max(p.start - 1, 0), min(p.stop + 1, n)) for p, n in zip(tile, SHAPE, strict=True))
    samples, pixels = (tuple(grid.ravel() for grid in np.mgrid[part]) for part in (near, tile))
    values = torch.as_tensor(information[samples])
    shares = usual_shares(bayer, *tile)
    found = ColourNeighbours(*tile, samples, pixels, shares).sum(values)
    # Away from the picture's edge, where demosaicing repeats samples.
    inside = np.all([(at > 0) & (at < n - 1) for at, n in zip(pixels, SHAPE, strict=True)], axis=0)
    wanted = (1 / demosaic_variance(np.ones(SHAPE), bayer)).sum(0)[pixels]
    np.testing.assert_allclose(found.numpy()[inside], wanted[inside])
    # A sample that is not there is missing where it belonged, and nowhere else.
    y, x = 4, 8
    kept = (samples[0] != y) | (samples[1] != x)
    left = samples[0][kept], samples[1][kept]
    without = ColourNeighbours(*tile, left, pixels, shares).sum(values[kept])
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
    tile = slice(1, 4), slice(1, 4)
    found = ColourNeighbours(*tile, samples, pixels, usual_shares("MONO", *tile)).sum(values)
    np.testing.assert_array_equal(found.numpy(), values.reshape(5, 5)[1:4, 1:4].ravel())


def shares_of(amplitude: np.ndarray, std: float = 0.0) -> np.ndarray:
    """Those of the inner pixels of a mosaic that begins with red."""
    height, width = amplitude.shape
    usual = usual_shares("RGGB", slice(2, height - 2), slice(2, width - 2))
    return shares_on_a_surface(usual, amplitude, np.full(amplitude.shape, std))


def mosaic(white: np.ndarray) -> np.ndarray:
    """What filters of unlike transmission leave of a grey picture."""
    rows, columns = np.mgrid[: white.shape[0], : white.shape[1]]
    return np.asarray(white * np.array([0.5, 1.0, 0.3])[bayer_colours("RGGB", rows, columns)])


def test_all_samples_count_on_one_surface_also_where_its_colour_is_vivid() -> None:
    shares = shares_of(mosaic(np.full((10, 12), 7.0)))
    np.testing.assert_array_equal(shares, usual_shares("RGGB", slice(2, 8), slice(2, 10)))


def test_samples_beyond_an_edge_count_little() -> None:
    white = np.full((10, 12), 0.05)
    white[:, 6:] = 1.0
    shares = shares_of(mosaic(white))
    # The pixels at either side of the edge, and what they take of beyond it.
    for column, beyond in ((5, 1), (6, -1)):
        for n, (_, x) in enumerate(AROUND):
            share, usual = shares[n, :, column - 2], usual_shares("RGGB", slice(2, 8), slice(2, 10))[n, :, 3]
            if x == beyond:
                assert share.max() < 1e-4, (column, n)
            elif x == -beyond:
                assert share.max() == usual.max() == 1.0 or n > 3, (column, n)


def test_a_colour_that_is_all_beyond_edges_keeps_its_samples() -> None:
    white = np.full((10, 12), 0.05)
    white[5] = 1.0  # a line of one row
    shares = shares_of(mosaic(white))
    assert (shares[:2, 3] == 1.0).all(), "along the line"
    is_green = shares[4, 3] == 0
    np.testing.assert_allclose(shares[2:4, 3][:, is_green], 1.0)
    assert (shares[2:4, 3][:, ~is_green] < 1e-4).all(), "the same colour is along the line"
    np.testing.assert_allclose(shares[4:, 3][:, ~is_green], 1.0)


def test_noise_and_what_nobody_knows_are_no_edges() -> None:
    white = np.random.default_rng(0).uniform(0.5, 1.5, (10, 12))
    usual = usual_shares("RGGB", slice(2, 8), slice(2, 10))
    np.testing.assert_array_equal(shares_of(mosaic(white), std=0.6), usual)
    assert shares_of(mosaic(white), std=0.0).min(where=usual > 0, initial=1.0) < 0.1
    white[:, 7:] = np.nan
    shares = shares_of(mosaic(np.where(np.isnan(white), np.nan, 1.0)))
    np.testing.assert_array_equal(shares, usual)
