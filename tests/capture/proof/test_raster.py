"""Rows that stand for a picture, their blocks and colours."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.capture.proof.raster import Raster


@pytest.mark.parametrize(
    ("size", "shape"),
    [
        ((64, 48), (48, 64)),
        ((1000, 600), (36, 1000)),
        ((400, 600), (80, 400)),
        ((1024, 600), (36, 1024)),
        ((1025, 600), (36, 342)),
        ((4000, 3000), (36, 800)),
    ],
)
def test_a_raster_is_whole_rows_of_small_pictures_and_some_of_large_ones(
    size: tuple[int, int], shape: tuple[int, int]
) -> None:
    raster = Raster(size)
    assert raster.shape == shape
    pixels = np.arange(size[0] * size[1], dtype=np.uint32).reshape(size[::-1])
    taken = raster.take(pixels).reshape(shape)
    rows, columns = np.divmod(taken, size[0])
    assert (rows[0, 0], rows[-1, 0]) == (0, size[1] - 1)
    # Spread evenly, but for one beside the first.
    assert rows[:3, 0].tolist().count(2) == 1
    assert np.ptp(np.diff(np.delete(rows[:, 0].astype(int), 1))) <= 1
    assert set(np.diff(columns[0].astype(int))) == {-(-size[0] // 1024) | 1}


@pytest.mark.parametrize("size", [(64, 48), (1025, 90), (7, 5)])
@pytest.mark.parametrize("bayer", ["RGGB", "GBRG"])
def test_channels_are_those_of_the_pixels_taken(size: tuple[int, int], bayer: str) -> None:
    raster = Raster(size)
    rows, columns = np.mgrid[: size[1], : size[0]]
    colours = np.array(["RGB".index(letter) for letter in bayer])[2 * (rows % 2) + columns % 2]
    assert raster.channels(bayer).tolist() == raster.take(colours.astype(np.uint16)).tolist()


@pytest.mark.parametrize("width", [890, 1025, 1280, 1920, 2048, 2448, 4096])
@pytest.mark.parametrize("height", [36, 71, 580, 1200])
def test_every_colour_is_seen_whatever_the_size(width: int, height: int) -> None:
    counts = np.bincount(Raster((width, height)).channels("RGGB"), minlength=3)
    assert counts[[0, 2]].min() > 0.4 * counts[1] > 0


def test_blocks_are_means_of_sixteen_parts_down_and_across() -> None:
    raster = Raster((70, 33))
    assert raster.pooled == 2 * 4
    values = np.random.default_rng(1).random((33, 70)).astype(np.float32)
    blocks = values[:32, :68].reshape(16, 2, 17, 4).mean((1, 3))
    assert raster.pool(values.ravel()) == pytest.approx(blocks.ravel(), rel=1e-5)
    small = Raster((9, 31))
    assert small.pooled == 1
    assert small.pool(np.arange(279, dtype=np.uint16)).tolist() == list(range(279))
