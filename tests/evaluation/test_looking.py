"""What a person asks of a result: regions, likeness, references, distances, reasons."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dsl_core.errors import DecodeError
from dsl_core.evaluation.comparison import compare
from dsl_core.evaluation.distance import distance_between, nearest_on_screen, on_screen
from dsl_core.evaluation.explanation import explain_pixel, undecided_ranges
from dsl_core.evaluation.regions import mask_of_outline, mask_of_runs, region_spectrum, runs_of
from dsl_core.evaluation.similarity import angle_map, likeness, spectrum_at
from dsl_core.model.result import Flag
from dsl_core.model.spectral import SpectralCurve

NM = np.arange(430.0, 661.0, 5.0)


def test_a_rectangle_holds_the_pixels_whose_centres_it_holds() -> None:
    mask = mask_of_outline([(1.5, 0.5), (4.5, 0.5), (4.5, 2.5), (1.5, 2.5)], (5, 7))
    assert np.argwhere(mask).tolist() == [[1, 2], [1, 3], [1, 4], [2, 2], [2, 3], [2, 4]]


@given(st.lists(st.tuples(st.floats(-20, 40), st.floats(-20, 40)), min_size=3, max_size=3))
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


def test_the_angle_does_not_see_brightness() -> None:
    spectrum = np.linspace(0.1, 0.9, NM.size)
    cube = np.stack([spectrum, 0.2 * spectrum, spectrum[::-1]], 1)[:, None].astype(np.float32)
    angles = angle_map(cube, spectrum)
    assert angles[0, :2] == pytest.approx(0, abs=1e-3)
    assert angles[0, 2] > 0.5
    with pytest.raises(DecodeError, match="complete spectrum"):
        angle_map(cube, np.full(NM.size, np.nan))


def test_metamers_look_alike_and_are_not() -> None:
    from dsl_core.optics.colour import observer_weights

    spectrum = 0.4 + 0.1 * np.sin(NM / 40)
    # What the eye under D65 cannot see: the part of a wiggle that its three weights are blind to.
    wiggle = 0.2 * np.sin(NM / 9)
    weights = observer_weights(NM)
    blind = wiggle - np.linalg.pinv(weights) @ (weights @ wiggle)
    cube = np.stack([spectrum, spectrum + blind, 1.5 * spectrum], 1)[:, None].astype(np.float32)
    found = likeness(cube, spectrum, NM)
    assert found.metamers(1.0, 0.05).tolist() == [[False, True, False]]
    assert found.same_spectrum(0.05).tolist() == [[True, False, True]]


def test_a_spectrum_is_not_continued_beyond_its_ends() -> None:
    bands = np.arange(430.0, 661.0, 10.0)
    nm = np.arange(400.0, 701.0, 3.0)
    np.testing.assert_allclose(spectrum_at(bands, nm, nm / 1000), bands / 1000)
    # Half a band further is still the band's own light.
    assert spectrum_at(bands, np.array([435.0, 655.0]), np.array([0.1, 0.3]))[0] == 0.1
    for low, high in ((400.0, 550.0), (436.0, 700.0)):
        with pytest.raises(DecodeError, match=rf"{low:g} to {high:g} nm.*430 to 660 nm"):
            spectrum_at(bands, np.array([low, high]), np.array([0.1, 0.3]))


def test_a_reference_of_another_scale_differs_only_by_the_scale() -> None:
    truth = np.linspace(0.2, 0.8, NM.size)
    reference = SpectralCurve.of(NM, truth)
    found = compare(truth / 2, NM, reference)
    assert found.scale == pytest.approx(2)
    assert found.angle_rad == pytest.approx(0, abs=1e-6)
    assert found.rmse > 0.2
    assert found.rmse_scaled == pytest.approx(0, abs=1e-9)
    assert found.delta_e_scaled < 1e-3 < found.delta_e


def test_only_shared_bands_are_compared() -> None:
    found = compare(np.full(NM.size, 0.5), NM, SpectralCurve.of([500.0, 600.0], [0.5, 0.5]))
    assert (found.bands, found.range_nm) == (21, (500.0, 600.0))
    with pytest.raises(DecodeError, match="5 are needed"):
        compare(np.full(NM.size, 0.5), NM, SpectralCurve.of([700.0, 800.0], [0.5, 0.5]))


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
