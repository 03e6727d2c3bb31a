"""The light of each order comes out of scan lines through a filter, relative to the zero order."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from dsl_core.calibration.orders.order_light import FilterLight, filter_light
from dsl_core.calibration.orders.order_place import PlanePixels
from dsl_core.model.plan import ScanLines
from dsl_core.model.rig import ProjectorResponse
from dsl_core.optics.lines.profile import zero_order_profile

FRAME_PX, LINES = 640, ScanLines(width_px=5, step_px=5)
RESPONSE = ProjectorResponse(blur_px=0.6, halo_peak_per_px=1e-3, halo_decay_px=20.0)
#: Light of each order over the zero order's, and its distance from it.
RATIO = {1: 0.11, -1: 0.07, 2: 0.006, -2: 0.004}
AT_PX = {1: 180.0, -1: -180.0, 2: 372.0, -2: -372.0}
DARK, NOISE = 0.05, 0.01


def seen(
    moved_px: float = 0.0,
    saturated: int = 0,
    uneven: float = 0.0,
    times: int = 1,
    widening: float = 1.0,
    blue_px: float = 0.0,
) -> FilterLight:
    """White pixels all over the image, a Gaussian of 3 px for each order; amplitudes differ by colour.

    ``uneven`` is by which share orders are brighter or darker in every other cell of the image; ``times`` how
    many times more columns the projector has, and ``widening`` what is known of that; ``blue_px`` is how much
    nearer to the zero order blue pixels see first orders, by the flank of a broad filter.
    """
    rng = np.random.default_rng(0)
    down, across = np.meshgrid(np.linspace(0.01, 0.99, 40), np.linspace(0.01, 0.99, 100), indexing="ij")
    place = np.stack([down.ravel(), across.ravel()])
    column = times * (10 + 620 * place[1])
    colour = np.arange(len(column)) % 3
    amplitude = np.array([8.0, 10.0, 6.0])[colour]
    centres = 2.0 + 5.0 * np.arange(128 * times)[:, None]
    distance = centres - column
    light = zero_order_profile(torch.as_tensor(moved_px - distance), -2.5, 2.5, RESPONSE).numpy()
    for order, ratio in RATIO.items():
        at_px = AT_PX[order] - np.sign(order) * blue_px * (colour == 2) + 6 * (place[1] - 0.5)
        bell = np.exp(-0.5 * ((distance / times - at_px) / 3.0) ** 2) / times
        cell = (4 * place[0]).astype(int) + (6 * place[1]).astype(int)
        light = light + ratio * (1 + uneven * (-1) ** cell) * LINES.step_px * bell / (
            3.0 * np.sqrt(2 * np.pi)
        )
    radiance = amplitude * light + DARK + NOISE * rng.standard_normal(light.shape)
    std = np.full(light.shape, NOISE)
    std[60, :saturated] = np.inf
    whole = {order: np.ones(len(column), bool) for order in RATIO}
    pixels = PlanePixels(column, np.full(len(column), 2.0), colour, place, whole)
    reach_px, unlit_px = (120.0 * times, 320.0 * times), (60.0 * times, 110.0 * times)
    frame_px = FRAME_PX * times
    return filter_light(LINES, pixels, radiance, std, RESPONSE, reach_px, unlit_px, frame_px, widening)


@pytest.fixture(scope="module")
def found() -> FilterLight:
    return seen()


@pytest.mark.parametrize("order", RATIO)
def test_every_order_is_measured_within_its_deviation(found: FilterLight, order: int) -> None:
    light = found.orders[order]
    # The lines tile the frame, so that the sum over lines is that of all light: five columns a line.
    assert light.ratio == pytest.approx(RATIO[order], abs=1e-3)
    assert np.all(np.abs(light.ratio - RATIO[order]) < 5 * light.std + 2e-4)
    assert np.all(light.std < 1e-3)


@pytest.mark.parametrize("order", [1, -1])
def test_first_orders_are_found_where_they_are(found: FilterLight, order: int) -> None:
    light = found.orders[order]
    assert abs(light.offset_px - AT_PX[order]) < 3 * light.offset_std_px
    assert light.width_px == pytest.approx(3.0, abs=0.7)
    assert light.share > 0.9


def test_the_zero_order_is_that_at_unit_shading(found: FilterLight) -> None:
    assert found.zero == pytest.approx([4.0, 5.0, 3.0], rel=2e-3)
    assert np.all(found.zero_std < 0.02)
    assert abs(found.shift_px[0]) < 3 * found.shift_px[1]
    assert found.saturated == 0


def test_a_zero_order_that_moved_and_saturated_pixels_are_told() -> None:
    moved = seen(moved_px=0.3, saturated=400)
    assert moved.shift_px[0] == pytest.approx(0.3, abs=0.05)
    assert moved.saturated == pytest.approx(0.1, abs=0.01)


def test_cells_that_differ_widen_the_deviation() -> None:
    light = seen(uneven=0.1).orders[1]
    # Every cell is a tenth off; those whose light comes from beside the frame are missing.
    assert light.std == pytest.approx(0.1 * RATIO[1] / np.sqrt(15), rel=0.25)


def test_cells_say_where_the_zero_order_and_each_order_were_seen(found: FilterLight) -> None:
    assert found.cells.shape == (3, 24)
    assert found.cells == pytest.approx(np.repeat(found.zero, 24).reshape(3, 24), rel=0.02)
    assert 1e-5 < float(np.nanmax(found.cells_std / found.cells)) < 0.02
    # Light of the order on the right is outside the frame for pixels on the right, and the other way round.
    by_column = {order: found.orders[order].cells.reshape(4, 6).sum(0) for order in (1, -1)}
    assert by_column[1][5] == 0.0
    assert by_column[-1][0] == 0.0
    assert by_column[1][0] > 0.9 * by_column[1][1] > 0


@pytest.mark.parametrize(("widening", "whole"), [(3.0, True), (1.0, False)])
def test_all_light_of_an_order_is_summed_on_a_projector_of_many_columns(widening: float, whole: bool) -> None:
    """Three times the columns spread an order over three times as many; windows of few lose a part of it."""
    wide = seen(times=3, widening=widening).orders
    for order in (1, -1):
        assert (wide[order].ratio == pytest.approx(RATIO[order], rel=0.01)) == whole
        assert wide[order].width_px == pytest.approx(9.0, rel=0.03) or not whole


@pytest.mark.parametrize(("widening", "whole"), [(2.0, True), (1.0, False)])
def test_colours_that_see_the_flank_of_a_broad_filter_are_summed_as_well(
    widening: float, whole: bool
) -> None:
    orders = seen(widening=widening, blue_px=24.0).orders
    for order in (1, -1):
        assert orders[order].ratio[:2] == pytest.approx(RATIO[order], rel=0.02)
        assert (orders[order].ratio[2] == pytest.approx(RATIO[order], rel=0.02)) == whole
