"""Passbands, paths and the values near them, against sums and traces done otherwise."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import torch

from dsl_core.calibration.film.order_paths import (
    LineFrames,
    Paths,
    _middles,
    filter_passband,
    reach_px,
    thinned,
    trace_paths,
    values_near,
)
from dsl_core.errors import CalibrationError
from dsl_core.model.spectral import SpectralCurve
from dsl_core.optics.correspondence import GratingModel
from dsl_core.optics.filters import nominal_filter
from dsl_core.optics.spectra import chain_response
from tests.cases.order_lines import LINES, TRUE_FILM, passband, plane_at, rig_with

RIG = rig_with(TRUE_FILM)


def test_the_centroid_is_that_of_all_that_lets_light_pass() -> None:
    nm = np.arange(530.0, 650.0, 0.1)
    curve = nominal_filter(590.0, fwhm_nm=40.0)
    light = chain_response(RIG, 1, nm).sum((0, 1)) * curve.at(nm)
    found = filter_passband(RIG, curve, 1, 0.5)
    assert found.centroid_nm == pytest.approx(float(light @ nm / light.sum()), abs=0.05)
    # The LEDs' light falls over this band, so that its middle is not the answer.
    assert abs(found.centroid_nm - 590.0) > 0.5
    per_colour = (chain_response(RIG, 1, nm).sum(1) * curve.at(nm)).sum(1) * 0.1
    assert found.signal == pytest.approx(per_colour, rel=0.02)
    assert found.density.sum(1) * 0.5 == pytest.approx([1, 1, 1], abs=1e-6)


def test_light_between_wavelengths_adds_up_to_all_of_it() -> None:
    found = passband(RIG, 540.0, 1)
    edges = np.linspace(470.0, 610.0, 30)
    for colour in range(3):
        same = np.full(29, colour)
        light, slope = found.between(edges[:-1], edges[1:], same)
        assert light.sum() == pytest.approx(1.0, abs=1e-6)
        moved, _ = found.between(edges[:-1] + 0.5, edges[1:] + 0.5, same)
        assert moved - light == pytest.approx(0.5 * slope, abs=2e-3)


def test_a_filter_beyond_all_light_is_refused() -> None:
    dark = SpectralCurve.of([1200.0, 1210.0, 1220.0], [0.0, 0.5, 0.0])
    blind = RIG.model_copy(
        update={"emission": tuple(SpectralCurve.of([400.0, 700.0, 701.0], [1.0, 1.0, 0.0]) for _ in range(3))}
    )
    with pytest.raises(CalibrationError, match=r"no light of order \+1 passes the filter from 1200"):
        filter_passband(blind, dark, 1, 0.5)


@pytest.mark.parametrize("order", [1, -1])
def test_wavelengths_follow_from_columns(order: int) -> None:
    plane, pixels = plane_at(700.0), np.arange(112 * 72)
    band = passband(RIG, 540.0, order)
    paths = trace_paths(RIG, plane, pixels, band, GratingModel(RIG))
    assert len(paths.at) > 1000
    where = torch.as_tensor(paths.pixels), torch.as_tensor(paths.depth_mm)
    there = (
        GratingModel(RIG).trace(*where, order, np.array([band.centroid_nm, band.centroid_nm + 6.0])).columns
    )
    assert paths.column_px == pytest.approx(there[0].numpy(), abs=1e-6)
    sample = np.arange(len(paths.at))
    assert paths.wavelength(sample, (there[1] - there[0]).numpy()) == pytest.approx(6.0, abs=5e-3)
    # Every part of the passband comes from inside the frame.
    ends = GratingModel(RIG).trace(*where, order, np.array(band.extent_nm)).columns.numpy()
    assert ends.min() > 8.0
    assert ends.max() < 640 - 9.0


def test_values_near_the_columns_are_all_those_and_no_others() -> None:
    pixels = np.arange(112 * 72)
    paths = trace_paths(RIG, plane_at(700.0), pixels, passband(RIG, 540.0, 1), GratingModel(RIG))
    numbers = (np.arange(128.0)[:, None] * 10_000 + pixels).astype(np.float32)
    std = np.ones(numbers.shape)
    std[60] = np.inf
    near = values_near(LineFrames(LINES, pixels, numbers, std), paths, 12.0)
    frame, pixel = np.divmod(near.value, 10_000)
    assert (paths.pixels[near.sample] == pixel).all()
    assert near.line_px == pytest.approx(2 + 5 * frame)
    assert np.abs(near.line_px - paths.column_px[near.sample]).max() <= 12.0
    centres = 2.0 + 5.0 * np.arange(128)[:, None]
    expected = (np.abs(centres - paths.column_px) <= 12.0).sum() - (
        np.abs(302.0 - paths.column_px) <= 12.0
    ).sum()
    assert len(near.value) == expected


def test_thinned_pixels_are_whole_cells_of_the_mosaic() -> None:
    assert len(thinned((112, 72))) == 112 * 72
    chosen = thinned((1000, 800))
    assert len(chosen) <= 140_000
    rows, columns = np.divmod(chosen, 1000)
    assert np.bincount(2 * (rows % 2) + columns % 2).tolist() == [len(chosen) // 4] * 4


def paths_of(**arrays: list[float]) -> Paths:
    """Paths of which only some columns are needed."""
    count = len(next(iter(arrays.values())))
    names = (
        "at",
        "pixels",
        "tiles",
        "colour",
        "depth_mm",
        "shading",
        "zero_px",
        "column_px",
        "per_nm",
        "per_nm2",
    )
    some: dict[str, Any] = {name: np.zeros(count) for name in names}
    none = np.zeros(0, np.int64)
    return Paths(**some | {name: np.array(each) for name, each in arrays.items()}, middle=(none, none))


def test_wavelengths_bend_with_the_second_derivative_of_columns() -> None:
    # 2 d + 0.1 d^2 / 2 = 10 for d = 5 less half of 0.05 * 5^2, to the second order.
    paths = paths_of(per_nm=[2.0, -2.0], per_nm2=[0.1, 0.1])
    found = paths.wavelength(np.array([0, 1, 1]), np.array([10.0, 10.0, -10.0]))
    assert found.tolist() == pytest.approx([4.375, -4.375, 5.625])


def test_a_profile_reaches_as_far_as_half_a_line_and_the_wider_side_of_its_filter() -> None:
    band = replace(passband(RIG, 540.0, 1), centroid_nm=540.0, extent_nm=(520.0, 550.0))
    assert reach_px(LINES, paths_of(per_nm=[0.4, -0.8]), band) == pytest.approx(2.5 + 20 * 0.6)
    assert reach_px(LINES, paths_of(per_nm=[]), band) == pytest.approx(2.5 + 20 * 0.5)


def test_a_tile_is_where_its_pixel_nearest_to_the_middle_is() -> None:
    # Tile 3 has the pixels of a row from 10 to 16, tile 5 too few, tile 4 six of two rows.
    tiles = np.array([3] * 7 + [5] * 5 + [4] * 6)
    pixels = np.array([*range(10, 17), *range(30, 35), 240, 241, 242, 340, 341, 348])
    chosen, at = _middles(tiles, pixels, 100)
    assert chosen.tolist() == [3, 4]
    # The mean of the second is row 2.5 and column 42: of both nearest pixels the first.
    assert pixels[at].tolist() == [13, 242]
    assert [each.tolist() for each in _middles(tiles[:0], pixels[:0], 100)] == [[], []]
