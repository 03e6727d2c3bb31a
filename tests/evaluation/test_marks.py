from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from scipy.ndimage import uniform_filter

from dsl_core.evaluation.marks import (
    distance_between,
    explain_pixel,
    largest_difference,
    mask_of_outline,
    mask_of_runs,
    nearest_on_screen,
    on_screen,
    region_spectrum,
    runs_of,
    undecided_ranges,
)
from dsl_core.model.result import Flag

NM = np.arange(430.0, 661.0, 5.0)


def test_a_rectangle_holds_the_pixels_whose_centres_it_holds() -> None:
    mask = mask_of_outline([(1.5, 0.5), (4.5, 0.5), (4.5, 2.5), (1.5, 2.5)], (5, 7))
    assert np.argwhere(mask).tolist() == [[1, 2], [1, 3], [1, 4], [2, 2], [2, 3], [2, 4]]


@given(st.lists(st.tuples(st.floats(-20, 40), st.floats(-20, 40)), min_size=3, max_size=3))
@example([(0.0, 1.0), (0.0, 2.225073858507203e-309), (1.0, 0.0)])
def test_a_triangle_holds_what_lies_on_the_inner_side_of_its_edges(
    corners: list[tuple[float, float]],
) -> None:
    mask = mask_of_outline(corners, (20, 30))
    y, x = np.mgrid[:20, :30]
    sides = np.stack(
        [
            (bx - ax) * (y - ay) - (by - ay) * (x - ax)
            for (ax, ay), (bx, by) in zip(corners, corners[1:] + corners[:1], strict=True)
        ]
    )
    assert mask[(sides > 1e-6).all(0) | (sides < -1e-6).all(0)].all()
    assert not mask[(sides > 1e-6).any(0) & (sides < -1e-6).any(0)].any()


@given(st.integers(0, 2**32 - 1))
def test_a_mask_comes_back_from_its_runs(seed: int) -> None:
    mask = np.random.default_rng(seed).random((7, 9)) > 0.5
    assert (mask_of_runs(runs_of(mask), mask.shape) == mask).all()
    assert not mask_of_runs([(99, 0, 3), (0, -5, 2)], mask.shape).any()


def test_a_region_leaves_pixels_without_spectrum_out() -> None:
    cube = np.full((3, 2, 2), 0.4, np.float32)
    cube[:, 0, 1] = 0.6
    cube[:, 1] = np.nan
    found = region_spectrum(cube, cube * 0.1, np.ones_like(cube), np.ones((2, 2), bool))
    assert (found.pixels, found.used) == (4, 2)
    np.testing.assert_allclose(found.mean, 0.5, rtol=1e-6)
    np.testing.assert_allclose(found.deviation, np.std([0.4, 0.6], ddof=1), rtol=1e-6)
    np.testing.assert_allclose(found.pixel_std, 0.05, rtol=1e-6)
    none = region_spectrum(cube, cube, cube, np.zeros((2, 2), bool))
    assert none.used == 0
    assert np.isnan(none.mean).all()


def test_a_mean_of_neighbours_is_as_uncertain_as_it_scatters_from_scan_to_scan() -> None:
    rng, mask = np.random.default_rng(4), np.zeros((20, 20), bool)
    mask[4:14, 5:17] = True
    # Noise that three by three pixels have together, as those of a Bayer mosaic do.
    noise = 0.01 * 3 * uniform_filter(rng.standard_normal((300, 20, 20)), (0, 3, 3))
    std = np.full((1, 20, 20), 0.01)
    shots = [region_spectrum(0.5 + each[None], std, std, mask) for each in noise]
    scattered = float(np.std([shot.mean[0] for shot in shots]))
    assert shots[0].mean_std[0] == pytest.approx(scattered, rel=0.2)
    assert scattered > 2 * float(np.mean([shot.deviation[0] for shot in shots])) / np.sqrt(mask.sum())
    one = np.zeros_like(mask)
    one[3, 3] = True
    assert region_spectrum(0.5 + noise[:1], std, std, one).mean_std[0] == pytest.approx(0.01)


@pytest.mark.parametrize("band", [0, 1, 2])
def test_a_band_that_is_missing_takes_no_spectrum_away(band: int) -> None:
    cube = np.full((3, 2, 2), 0.4, np.float32)
    cube[:, 0, 1] = 0.6
    cube[:, 1, 0] = np.nan
    cube[band] = np.nan
    found = region_spectrum(cube, 0.1 * cube, np.ones_like(cube), np.ones((2, 2), bool))
    assert (found.pixels, found.used) == (4, 3)
    others = np.arange(3) != band
    np.testing.assert_allclose(found.mean[others], np.mean([0.4, 0.4, 0.6]), rtol=1e-6)
    np.testing.assert_allclose(found.deviation[others], np.std([0.4, 0.4, 0.6], ddof=1), rtol=1e-5)
    assert np.isnan([found.mean[band], found.deviation[band], found.pixel_std[band]]).all()
    one = region_spectrum(cube, cube, cube, np.array([[True, False], [False, False]]))
    assert one.used == 1
    assert np.flatnonzero(np.isnan(one.mean)).tolist() == [band]
    assert np.isnan(one.deviation).all()
    np.testing.assert_array_equal(one.spread, one.pixel_std)


def test_distance_counts_errors_along_the_connection_only() -> None:
    a, b = np.array([0.0, 0.0, 500.0]), np.array([30.0, 40.0, 500.0])
    found = distance_between(a, b, 1.0, 0.0)
    assert found.mm == pytest.approx(50)
    assert found.std_mm == pytest.approx(0)
    assert distance_between(a, 2 * a, 3.0, 4.0).std_mm == pytest.approx(5)


def test_the_foremost_point_under_the_mouse_is_meant() -> None:
    points = np.array([[0.0, 0, -10], [0, 0, -5], [3, 0, -5], [0, 0, 5]])
    projection = np.array([[1.0, 0, 0, 0], [0, 1, 0, 0], [0, 0, -1, -1], [0, 0, -1, 0]])
    seen = on_screen(points, projection)
    assert np.isnan(seen[3]).all()
    assert nearest_on_screen(seen, (0.0, 0.0), (100, 100)) == 1
    assert nearest_on_screen(seen, (-0.9, 0.9), (100, 100)) is None


def test_reasons_name_bands_and_deviations() -> None:
    share = np.ones(NM.size)
    share[:3] = 0.1
    share[-1] = 0.2
    assert undecided_ranges(NM, share) == "430–440 nm, 660 nm"
    text = explain_pixel(int(Flag.BANDS_UNREACHED | Flag.NOT_REFINED), NM, share, 1.234)
    assert len(text) == 2
    assert any("430–440 nm" in line for line in text)
    assert any("±1.2 mm" in line for line in text)
    assert explain_pixel(0, NM) == []


def test_two_spectra_differ_where_it_is_clearest_for_their_deviations() -> None:
    nm, a, b = np.array([450.0, 500.0, 550.0]), np.array([0.2, 0.3, np.nan]), np.array([0.1, 0.319, 0.3])
    found = largest_difference(nm, a, b, np.array([0.06, 0.003, 0.0]), np.array([0.08, 0.004, 0.0]))
    assert found is not None
    assert (found.value, found.std) == pytest.approx((-0.019, 0.005))
    assert found.nm == 500.0
    assert not found.is_shown
    found = largest_difference(nm, a, b, np.full(3, 0.003), np.full(3, 0.004))
    assert found is not None
    assert found.is_shown
    assert largest_difference(nm, a, b, np.zeros(3), np.zeros(3)) is None
