from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from dsl_core.calibration.orders.order_place import (
    LineGraph,
    OrderPlace,
    PlanePixels,
    _fit,
    _Peak,
    _peak,
    by_cell,
    find_order,
    find_second,
    of_colours,
)

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


def on_its_side(distance_px: float) -> LineGraph:
    """A camera on its side sees few columns: in one or two rows of cells the order is in the frame."""
    down, across = np.meshgrid(np.linspace(0.01, 0.99, 60), np.linspace(0.01, 0.99, 160), indexing="ij")
    place = np.stack([down.ravel(), across.ravel()])
    column = 430 - 225 * place[0]
    lines = (LINE_PX - 1) / 2 + np.arange(0, FRAME_PX, LINE_PX)
    y, x = place - 0.5
    at = distance_px - 21 * y - 20 * x + 18 * x**2
    signal = np.exp(-0.5 * ((lines[:, None] - column - at) / 4.0) ** 2)
    signal += 0.02 * np.random.default_rng(2).standard_normal(signal.shape)
    pixels = PlanePixels(column, np.ones(len(column)), np.zeros(len(column), int), place, {})
    std = np.full(signal.shape, 4e-4)
    return LineGraph(signal, std, lines[:, None] - column, np.ones(len(column)), pixels, FRAME_PX)


@pytest.mark.parametrize("distance_px", [306.0, 310.0, 313.0, 316.0, 319.0])
def test_cells_that_see_a_part_of_an_order_do_not_bend_its_place(distance_px: float) -> None:
    found = find_order(on_its_side(distance_px), 1, REACH_PX)
    assert found is not None
    middle = float(found.at(np.array([[0.5], [0.5]]))[0])
    assert abs(middle - distance_px) < 2 * found.std_px
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


def pixels_at(place: np.ndarray, colour: np.ndarray | None = None) -> PlanePixels:
    count = place.shape[1]
    colours = np.zeros(count, int) if colour is None else colour
    return PlanePixels(
        np.linspace(0.0, count - 1, count),
        np.full(count, 0.5),
        colours,
        place,
        {1: np.arange(count) % 2 == 0},
    )


def test_cells_are_four_down_and_six_across() -> None:
    place = np.array([[0.0, 0.24, 0.26, 0.99, 1.0], [0.0, 0.17, 0.16, 0.99, 1.0]])
    pixels = pixels_at(place)
    assert pixels.cell.tolist() == [0, 1, 6, 23, 23]
    some = pixels.at(np.array([False, True, True, False, False]))
    assert some.column_px.tolist() == [1.0, 2.0]
    assert some.place.tolist() == place[:, 1:3].tolist()
    assert some.whole[1].tolist() == [False, True]
    masks = by_cell(pixels, np.arange(5) != 3)
    assert len(masks) == 24
    assert [np.flatnonzero(masks[cell]).tolist() for cell in (0, 1, 6, 23)] == [[0], [1], [2], [4]]


def test_a_colour_is_the_mean_of_cells_of_twelve_pixels_as_sure_as_they_agree() -> None:
    # Red: cells of 12, 12, 12 and 11 pixels; green: one cell.
    counts, colours = [12, 12, 12, 11, 20], [0, 0, 0, 0, 1]
    across = np.repeat([0.05, 0.2, 0.4, 0.55, 0.05], counts)
    values = np.repeat([1.0, 2.0, 6.0, 99.0, 5.0], counts)
    pixels = pixels_at(np.stack([np.zeros(len(across)), across]), np.repeat(colours, counts))
    mean, std = of_colours(pixels, values, np.ones(len(values), bool), np.median)
    assert mean[0] == 3.0
    assert std[0] == pytest.approx(np.std([1, 2, 6]) / 2**0.5)
    assert np.isnan(mean[1:]).all()
    assert np.isinf(std[1:]).all()


def test_windows_are_inside_the_frame_by_half_of_themselves() -> None:
    graph = graph_of(200.0, 0.0)
    centre = np.full(len(graph.amplitude), 100.0)
    at = graph.pixels.column_px + 100.0
    assert graph.holds(centre, 25.0).tolist() == ((at > 25) & (at < 639 - 25)).tolist()
    assert 0.5 < graph.holds(centre, 25.0).mean() < 0.95


def peak_of(light: np.ndarray, noise: float = 1e-4, reference: float = 1.0) -> Any:
    """The peak of light from -20 to 120 px in bins of two, of a search between 0 and 100."""
    sums = np.stack([light, np.full(70, noise), np.full(70, reference)])
    return _peak(sums, (0.0, 100.0), 20.0)


AT = -20.0 + (np.arange(70) + 0.5) * 2.0


def test_a_peak_is_the_mean_and_the_width_of_all_light_within_its_window() -> None:
    light = np.exp(-0.5 * ((AT - 62.5) / 4.0) ** 2) + 0.4 * np.exp(-0.5 * ((AT - 12.0) / 2.0) ** 2)
    found = peak_of(light)
    assert found.centre_px == pytest.approx(62.5, abs=0.02)
    assert found.width_px == pytest.approx(4.0, abs=0.01)
    window = np.abs(AT - 62.5) < 20
    assert found.share == pytest.approx(light[window].sum() / light.sum(), rel=1e-6)
    total = light[window].sum()
    spread = 1e-4 * ((AT - found.centre_px) ** 2)[window].sum()
    assert found.centre_std_px == pytest.approx(np.sqrt(spread) / total, rel=1e-3)
    outside = np.count_nonzero(~window) * 1e-4
    assert found.share_std == pytest.approx(total / light.sum() ** 2 * np.sqrt(outside), rel=1e-3)


def test_light_is_that_over_what_pixels_see_of_the_zero_order() -> None:
    light, reference = np.exp(-0.5 * ((AT - 63.0) / 4.0) ** 2), np.where(AT < 60, 2.0, 0.5)
    sums = np.stack([light * reference, np.full(70, 1e-4), reference])
    found = _peak(sums, (0.0, 100.0), 20.0)
    assert found is not None
    assert found.centre_px == pytest.approx(63.0, abs=0.02)


@pytest.mark.parametrize(
    ("height", "noise", "is_found"),
    # Nine bins of this height stand eight deviations above nothing, and are a share of the zero order.
    [(1e-3, 1.2e-7, True), (1e-3, 1.5e-7, False), (2.1e-4, 1e-12, True), (1.9e-4, 1e-12, False)],
)
def test_a_peak_stands_eight_deviations_out_and_is_two_parts_in_ten_thousand(
    height: float, noise: float, is_found: bool
) -> None:
    light = height * (np.abs(AT - 50.0) < 40)
    assert (peak_of(light, noise) is not None) == is_found


@pytest.mark.parametrize(("centre", "is_found"), [(1.0, True), (-2.0, False), (99.0, True), (102.0, False)])
def test_a_peak_is_where_an_order_may_be(centre: float, is_found: bool) -> None:
    light = np.exp(-0.5 * ((AT - centre) / 2.0) ** 2)
    assert (peak_of(light) is not None) == is_found


def test_the_second_order_is_a_multiple_of_the_first_or_where_it_usually_is() -> None:
    graph = graph_of(180.0, 10.0)
    first = OrderPlace(np.array([82.0, 0.0, 0.0, 10.0 * 82 / 180, 0.0, 0.0]), 0.3, 0.9, 0.01, 3.0)
    found = find_second(graph, 1, first)
    assert found is not None
    # What is seen is at 180 px, 2.195 times as far.
    times = found.coefficients[0] / 82.0
    assert times == pytest.approx(180 / 82, rel=5e-3)
    assert found.coefficients == pytest.approx(times * first.coefficients)
    assert found.std_px == pytest.approx(times * 0.3)
    assert found.share > 0.5
    dark = LineGraph(graph.signal * 0, *list(vars(graph).values())[1:])
    usual = find_second(dark, 1, first)
    assert usual is not None
    assert usual.coefficients == pytest.approx(2.125 * first.coefficients)
    assert (usual.share, usual.share_std) == (0.0, 0.0)
    assert np.isnan(usual.width_px)
    assert find_second(graph, 1, None) is None


def test_the_place_of_an_order_is_as_sure_as_cells_agree_with_its_quadratic(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Peaks of all cells, off a quadratic by half a pixel up and down, against least squares written out."""
    graph = graph_of(200.0, 0.0)
    cells = graph.pixels.cell
    middles = np.stack([graph.pixels.place[:, cells == cell].mean(1) for cell in range(24)], 1)
    y, x = middles - 0.5
    off = np.where(np.arange(24) % 2, 0.5, -0.5)
    centres = 3.0 + 4.0 * x - 2.0 * y * y + off
    centres[5] += 40.0
    peaks = [_Peak(float(each), 0.4, 0.8, 0.05, 2.5) for each in centres]
    monkeypatch.setattr("dsl_core.calibration.orders.order_place._peaks", lambda *_: peaks)
    before = OrderPlace(np.array([200.0, 0, 0, 0, 0, 0]), 9.0, 0.7, 0.02, 5.0)
    wide = LineGraph(**{**vars(graph), "frame_px": 10_000})
    monkeypatch.setattr(LineGraph, "holds", lambda *_: np.ones(len(cells), bool))
    found = _fit(wide, 1, before.at(graph.pixels.place), (-20.0, 20.0), before)
    assert found is not None
    terms = np.stack([np.ones(24), x, y, x * x, x * y, y * y], 1)[np.arange(24) != 5]
    damping = np.diag([1e-9] + [(0.3 / 13) ** 2] * 5)
    used = centres[np.arange(24) != 5]
    change = np.linalg.solve(terms.T @ terms + damping, terms.T @ used)
    assert found.coefficients == pytest.approx(before.coefficients + change)
    left = used - terms @ change
    lever = np.linalg.inv(terms.T @ terms + damping)[0, 0]
    assert found.std_px == pytest.approx(np.sqrt(((left**2).mean() + 0.3**2 + 0.4**2) * lever))
    assert (found.share, found.share_std, found.width_px) == (0.7, 0.02, 2.5), "the share of the first look"
    first = _fit(wide, 1, np.zeros(len(cells)), (150.0, 400.0))
    assert first is not None
    assert first.share == 0.8
    assert first.share_std == pytest.approx(0.05 / 24**0.5)
