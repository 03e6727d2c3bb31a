"""How a scan is cut into tiles, and what an offset that all frames share makes of spectra."""

from __future__ import annotations

import pytest
import torch

from dsl_core.reconstruction.spectral.solver import Prior, Spectra
from dsl_core.reconstruction.spectral.spectra import LEAST_TILE, TILE, tile_shape, with_offset

BANDS = 4


def test_tiles_shrink_with_the_bands_so_that_memory_stays() -> None:
    assert tile_shape(51) == TILE
    for bands in (61, 120, 231, 465):
        rows, columns = tile_shape(bands)
        assert LEAST_TILE[0] <= rows < TILE[0]
        assert LEAST_TILE[1] <= columns < TILE[1]
        assert rows % 2 == columns % 2 == 0, "the Bayer phase would change from tile to tile"
    assert tile_shape(465) == LEAST_TILE


def test_an_offset_that_looks_like_a_grey_makes_spectra_as_unsure() -> None:
    prior = Prior()
    matrix = torch.full((1, BANDS, 1), 1e8)
    like_grey = matrix[0] + prior.level_std**-2
    spectra = Spectra.empty(torch.zeros((BANDS, 1)))
    spectra.std[:] = 0.004
    variance = (0.003 * like_grey) ** 2
    assert with_offset(spectra, matrix, variance, prior).std.numpy() == pytest.approx(0.005)
