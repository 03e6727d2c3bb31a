from __future__ import annotations

import numpy as np
import pytest

from dsl_core.capture.preview import quick_picture, statistics
from dsl_core.errors import DecodeError
from dsl_core.model.rig import BayerPattern
from dsl_core.optics.sensor import bayer_channels

PATTERNS: tuple[BayerPattern, ...] = ("RGGB", "BGGR", "GRBG", "GBRG")


def mosaic_of(colour: tuple[int, int, int], bayer: BayerPattern, shape: tuple[int, int]) -> np.ndarray:
    return np.asarray(colour, np.uint16)[bayer_channels(bayer, *shape)]


@pytest.mark.parametrize("bayer", PATTERNS)
def test_colours_come_out_whatever_the_mosaic(bayer: BayerPattern) -> None:
    mosaic = mosaic_of((4095, 1024, 0), bayer, (6, 8))
    picture = quick_picture(mosaic, bayer, 4095)
    assert picture.shape == (3, 4, 3)
    assert (picture == (255, 128, 0)).all()
    figures = statistics(mosaic, bayer, 4095)
    assert figures.saturated == (1.0, 0.0, 0.0)
    assert figures.mean_dn == (4095.0, 1024.0, 0.0)
    assert figures.histogram.sum(1).tolist() == [12, 24, 12]
    assert figures.histogram[0, 255] == 12
    assert figures.histogram[1, 64] == 24


def test_one_saturated_pixel_shows_its_cell_in_red() -> None:
    mosaic = np.full((4, 4), 100, np.uint16)
    mosaic[3, 2] = 4095
    picture = quick_picture(mosaic, "RGGB", 4095, show_saturation=True)
    red = (picture == (255, 0, 0)).all(2)
    assert red.tolist() == [[False, False], [False, True]]


def test_focus_rises_with_sharp_edges_and_not_with_exposure() -> None:
    columns = np.arange(64)
    sharp = np.where(columns % 16 < 8, 1000, 3000)
    soft = np.convolve(np.pad(sharp, 4, mode="wrap"), np.ones(9) / 9, "valid")
    scores = [
        statistics(np.tile(row, (32, 1)).astype(np.uint16), "RGGB", 4095).focus
        for row in (sharp, soft, sharp // 2)
    ]
    assert scores[0] > 3 * scores[1]
    assert scores[2] == pytest.approx(scores[0], rel=1e-3)


def test_a_picture_of_one_row_is_told() -> None:
    with pytest.raises(DecodeError, match="at least 2 x 2"):
        statistics(np.zeros((1, 8), np.uint16), "RGGB", 4095)
