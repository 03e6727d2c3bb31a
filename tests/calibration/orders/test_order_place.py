from __future__ import annotations

import numpy as np
import pytest

from dsl_core.calibration.orders.order_place import LineGraph, PlanePixels, find_order

FRAME_PX, LINE_PX, REACH_PX = 640, 5, (150.0, 400.0)


def graph_of(distance_px: float, bend_px: float, width_px: float = 3.0) -> LineGraph:
    """White pixels all over the image that see one order ``distance_px`` to the right of the zero order."""
    down, across = np.meshgrid(np.linspace(0.01, 0.99, 60), np.linspace(0.01, 0.99, 160), indexing="ij")
    place = np.stack([down.ravel(), across.ravel()])
    column = 30 + 580 * place[1]
    lines = (LINE_PX - 1) / 2 + np.arange(0, FRAME_PX, LINE_PX)
    at = distance_px + bend_px * (place[1] - 0.5) ** 2
    signal = np.exp(-0.5 * ((lines[:, None] - column - at) / width_px) ** 2)
    pixels = PlanePixels(column, np.ones(len(column)), np.zeros(len(column), int), place, {})
    return LineGraph(
        signal, np.full(signal.shape, 1e-6), lines[:, None] - column, np.ones(len(column)), pixels, FRAME_PX
    )


@pytest.mark.parametrize("distance_px", [200.0, 290.0, 320.0, 335.0, 365.0])
def test_an_order_that_leaves_the_frame_is_placed_by_the_pixels_that_see_all_of_it(
    distance_px: float,
) -> None:
    found = find_order(graph_of(distance_px, bend_px=25.0), 1, REACH_PX)
    assert found is not None
    middle = float(found.at(np.array([[0.5], [0.5]]))[0])
    assert abs(middle - distance_px) < 3 * found.std_px
    assert found.std_px < 2


def test_light_that_is_none_has_no_place() -> None:
    dark = graph_of(200.0, 0.0)
    assert find_order(LineGraph(dark.signal * 0, *list(vars(dark).values())[1:]), 1, REACH_PX) is None


@pytest.mark.parametrize("noise", [0.02, 0.3])
def test_noise_is_in_the_deviations_of_place_and_share(noise: float) -> None:
    # Three cells carry a constant only, whose scatter says little of their noise.
    places, shares, stated, stated_share = [], [], [], []
    for seed in range(6):
        graph = graph_of(260.0, 0.0)
        noisy = graph.signal + noise * np.random.default_rng(seed).standard_normal(graph.signal.shape)
        rest = list(vars(graph).values())[2:]
        found = find_order(LineGraph(noisy, np.full(noisy.shape, noise**2), *rest), 1, REACH_PX)
        assert found is not None
        places.append(float(found.at(np.array([[0.5], [0.5]]))[0]) - 260.0)
        shares.append(found.share)
        stated.append(found.std_px)
        stated_share.append(found.share_std)
    assert np.abs(np.array(places) / stated).max() < 3
    assert np.std(shares) < 3 * np.mean(stated_share)
    assert np.mean(stated_share) < 20 * np.std(shares)
