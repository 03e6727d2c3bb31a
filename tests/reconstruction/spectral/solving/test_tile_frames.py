"""What a tile hands to the solver: its own pixels in three colours, and how sure they are."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from numpy.typing import NDArray

from dsl_core.optics.lines.line_set import LineSet
from dsl_core.optics.pixel_model import MODEL_ERROR
from dsl_core.optics.sensor import bayer_channels
from dsl_core.reconstruction.spectral.solving.tile_frames import Pixels, TileFrames
from dsl_core.simulation.published_rig import published_rig

SHAPE, FRAMES = (12, 16), 3
RIG = published_rig()
RGB = np.array([30.0, 50.0, 20.0])
LEVEL = RGB[bayer_channels(RIG.sensor.bayer, *SHAPE)].astype(np.float32)


def tile(
    amplitude: NDArray[np.float32], std: float, offset: float = 0.0, first: tuple[int, int] = (4, 6)
) -> TileFrames:
    """Four rows and six columns of a picture of one colour, of which one pixel is not valid."""

    def full(value: float) -> NDArray[np.float32]:
        return np.full(SHAPE, value, np.float32)

    valid = np.ones(SHAPE, bool)
    valid[5, 8] = False
    known = Pixels(
        full(100.0), full(700.0), full(1.0), full(0.0), amplitude, full(std), full(offset), full(std),
        full(0.0), valid,
    )  # fmt: skip
    radiance = np.stack([(k + 1) * LEVEL for k in range(FRAMES)]) + np.float32(offset)
    deviation = np.full(radiance.shape, std, np.float32)
    deviation[1, 4, 8] = np.inf
    like = torch.empty(0, dtype=torch.float64)
    rows, columns = slice(first[0], first[0] + 4), slice(first[1], first[1] + 6)
    return TileFrames(RIG, radiance, deviation, known, rows, columns, like)


def test_the_tile_has_its_valid_pixels_where_they_are_in_the_picture() -> None:
    rows, columns = tile(LEVEL, 1.0).place()
    assert len(rows) == 23
    assert (rows.min(), rows.max(), columns.min(), columns.max()) == (4, 7, 6, 11)
    assert not ((rows == 5) & (columns == 8)).any()


def test_of_frames_that_begin_at_a_later_row_the_rows_near_the_tile_are_used() -> None:
    whole = tile(LEVEL, 1.0)
    assert whole._radiance.shape == (FRAMES, 8, 10)


@pytest.mark.parametrize("first", [(4, 6), (3, 6), (4, 5), (5, 7), (0, 1)])
def test_colours_are_the_same_wherever_a_tile_begins(first: tuple[int, int]) -> None:
    colour, _ = tile(LEVEL, 1.0, first=first).zero_order_colour()
    assert (colour - torch.as_tensor(RGB)[:, None]).abs().max() < 1e-5


@pytest.mark.parametrize("std", [0.5, 3.0])
def test_a_mean_of_neighbours_is_surer_than_one_of_them(std: float) -> None:
    frames = tile(LEVEL, std)
    colour, variance = frames.zero_order_colour()
    assert colour == pytest.approx(np.tile(RGB[:, None], 23))
    # A colour is measured, or the mean of two or four: its variance is that of a sample, a half or a quarter.
    assert np.unique((variance / std**2).numpy()).tolist() == [0.25, 0.5, 1.0]
    own = torch.as_tensor(bayer_channels(RIG.sensor.bayer, *SHAPE)[frames.place()]).long()
    assert (variance[own, torch.arange(23)] == std**2).all()


def test_frames_of_the_own_colour_are_without_the_offset_and_weigh_by_noise_and_model() -> None:
    frames = tile(LEVEL, 0.5, offset=7.0)
    radiance, weight = frames.own()
    own = torch.as_tensor(bayer_channels(RIG.sensor.bayer, *SHAPE)[frames.place()]).long()
    for k in range(FRAMES):
        assert radiance[k] == pytest.approx((k + 1) * RGB[own])
    assert weight[2] == pytest.approx(1 / (0.5**2 + (MODEL_ERROR * radiance[2]) ** 2), rel=1e-9)


def test_saturated_samples_have_no_weight_in_the_frame_they_are_of() -> None:
    lines = LineSet(5, 4, 2.0, FRAMES, FRAMES)
    dark = np.zeros(SHAPE, np.float32)
    radiance, weight = tile(dark, 0.5, offset=7.0).samples(range(1, 3), lines)
    rows, columns = tile(dark, 0.5).place()
    hit = (rows == 4) & (columns == 8)
    assert radiance.shape == (2, 23)
    assert weight[0].numpy()[hit] == 0.0
    assert (weight[0].numpy()[~hit] > 0).all()
    assert (weight[1] > 0).all()
    assert radiance[1] == pytest.approx(3 * LEVEL[rows, columns].astype(float))
