"""Means over tiles stand where their pixels do, and wrong pixels do not count."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.calibration.common.tiles import _straight, tile_columns, tile_edges, tile_of_pixels

SIZE = (96, 64)
Y, X = np.mgrid[: SIZE[1], : SIZE[0]].astype(float)
COLUMNS = 100 + 3.0 * X - 0.4 * Y


def test_tiles_fill_the_image_and_are_numbered_row_by_row() -> None:
    rows, columns = tile_edges(SIZE)
    tiles = tile_of_pixels(SIZE)
    assert (rows[0], rows[-1], columns[0], columns[-1]) == (0, 64, 0, 96)
    assert np.bincount(tiles.ravel()).tolist() == [16] * (16 * 24)
    assert tiles[0, 4] == 1
    assert tiles[4, 0] == 24
    assert tuple(len(edges) - 1 for edges in tile_edges((890, 580))) == (32, 48), "smooth maps need no more"
    # Images of few pixels still have tiles of some.
    assert tile_of_pixels((3, 2)).max() == 0


def test_means_of_columns_belong_to_the_means_of_positions() -> None:
    columns = COLUMNS.copy()
    columns[10, 10] += 0.8
    columns[1, 1:3] = np.nan
    found = tile_columns(columns, np.full(columns.shape, 0.1))
    at = 100 + 3.0 * found.camera_px[:, 0] - 0.4 * found.camera_px[:, 1]
    assert found.column_px == pytest.approx(at, abs=1e-9)
    assert len(found) == 16 * 24
    # A pixel that is far off bends the course of its whole tile, which is then left out.
    columns[10, 10] += 40
    assert len(tile_columns(columns, np.full(columns.shape, 0.1))) == 16 * 24 - 1


def test_deviations_are_those_of_weighted_means_over_the_pixels_used() -> None:
    columns = COLUMNS.copy()
    columns[0, :2] = np.nan
    std = np.where(X < 48, 0.1, 0.3)
    found = tile_columns(columns, std)
    assert found.std_px[0] == pytest.approx(0.1 / np.sqrt(14))
    assert found.std_px[1] == pytest.approx(0.1 / 4)
    assert found.std_px[-1] == pytest.approx(0.3 / 4)


def test_tiles_of_which_little_is_known_are_left_out() -> None:
    std = np.full(COLUMNS.shape, 0.1)
    std[:4, :4] = np.where(np.arange(4) < 2, 0.1, np.inf)
    std[:4, 4:8] = np.where(np.arange(4) < 3, 0.1, 0.0)
    found = tile_columns(COLUMNS, std)
    assert len(found) == 16 * 24 - 1
    assert found.camera_px[0] == pytest.approx([5.0, 1.5])


def test_a_course_is_the_weighted_plane_through_a_tile() -> None:
    rng = np.random.default_rng(1)
    x, y, tiles = rng.random(60), rng.random(60), np.repeat([0, 1, 2], 20)
    values = np.choose(tiles, [2 + 3 * x - y, 1 - 0.5 * x + 4 * y, 7.0 + x])
    weight = 1e-3 * rng.random(60)
    assert _straight(tiles, x, y, values, weight) == pytest.approx(values)
    # Pixels in one line have no slope across it.
    flat = _straight(tiles, x, np.zeros(60), np.choose(tiles, [x, x, x]), weight)
    mean = [np.average(x[tiles == k], weights=weight[tiles == k]) for k in range(3)]
    assert flat == pytest.approx(np.array(mean)[tiles])
