"""How a scan is cut into tiles, and what an offset that all frames share makes of spectra."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from dsl_core.reconstruction.spectral.solving.solver import Prior, Spectra
from dsl_core.reconstruction.spectral.spectra import LEAST_TILE, TILE, blurred_mask, tile_shape, with_offset

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


@pytest.mark.parametrize(("width", "blur_px"), [(900, 10.0), (360, 4.0), (60, 1.0)])
def test_masks_are_as_soft_as_a_ninetieth_of_the_picture_and_at_least_a_pixel(
    width: int, blur_px: float
) -> None:
    mask = np.zeros((12, width), np.float32)
    mask[:, width // 2 :] = 1
    edge = np.diff(blurred_mask(mask)[6])
    x = np.arange(width - 1) + 1 - width // 2
    assert edge.sum() == pytest.approx(1, abs=1e-5)
    assert edge @ x == pytest.approx(0, abs=1e-3)
    assert np.sqrt(edge @ x**2) == pytest.approx(blur_px, rel=0.03)
