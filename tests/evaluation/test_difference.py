from __future__ import annotations

import numpy as np
import pytest

from dsl_core.errors import DecodeError
from dsl_core.evaluation.difference import (
    compare_results,
    difference_table,
    require_same_places,
    shared_bands,
)

NM = np.array([430.0, 440.0, 450.0])


def test_figures_count_pixels_that_both_have() -> None:
    first, second = np.full((4, 5), 700.0), np.full((4, 5), 701.0)
    first[0], second[1, 0] = np.nan, np.nan
    found = compare_results(first, second)
    assert (found.pixels, found.share) == (14, 14 / 20)
    assert (found.depth_rms_mm, found.depth_bias_mm, found.depth_median_abs_mm) == (1.0, 1.0, 1.0)
    assert found.reflectance_rms is None
    assert len(difference_table(found)) == 4


def test_spectra_are_compared_over_common_bands() -> None:
    bands = shared_bands(NM, np.array([440.0, 450.0, 460.0]))
    assert bands == [(1, 0), (2, 1)]
    depth = np.full((2, 2), 700.0)
    first, second = np.full((3, 2, 2), 0.4), np.full((3, 2, 2), 0.5)
    found = compare_results(depth, depth, first, second, bands)
    assert found.reflectance_rms == pytest.approx(0.1)
    assert found.reflectance_bias == pytest.approx(0.1)
    assert found.mean_angle_rad == pytest.approx(0, abs=1e-6)
    assert found.reflectance_rms_std == pytest.approx(0, abs=1e-12)
    assert ("Common bands", "2") in [(row.figure, row.value) for row in difference_table(found)]


def test_a_band_that_no_pixel_has_leaves_the_others_compared() -> None:
    depth = np.full((2, 2), 700.0)
    first, second = np.full((3, 2, 2), 0.4), np.full((3, 2, 2), 0.5)
    second[1] = np.nan
    bands = [(0, 0), (1, 1), (2, 2)]
    found = compare_results(depth, depth, first, second, bands)
    assert found.bands == 2
    assert (found.reflectance_rms, found.reflectance_bias) == pytest.approx((0.1, 0.1))
    # A pixel that lacks a band of others is not compared.
    second[0, 0, 0] = np.nan
    assert compare_results(depth, depth, first, second, bands).reflectance_rms == pytest.approx(0.1)
    assert compare_results(depth, depth, first, second, [(1, 1)]).reflectance_rms is None


def test_results_that_do_not_fit_say_why() -> None:
    with pytest.raises(DecodeError, match="5 x 4 and 6 x 4 pixels"):
        compare_results(np.zeros((4, 5)), np.zeros((4, 6)))
    with pytest.raises(DecodeError, match="No pixel"):
        compare_results(np.full((4, 5), np.nan), np.zeros((4, 5)))
    assert shared_bands(NM, np.empty(0)) == []


def test_only_results_that_say_where_they_are_can_be_of_different_parts() -> None:
    here, there = np.arange(5), np.arange(5) + 100
    require_same_places((here, here), (here.copy(), None))
    require_same_places((None, None), (there, here))
    with pytest.raises(DecodeError, match=r"\(x 0 to 4, y 0 to 4, and x 100 to 104\)"):
        require_same_places((here, here), (there, None))


def test_figures_say_how_sure_they_are() -> None:
    rng = np.random.default_rng(4)
    first = np.full((60, 80), 700.0)
    rows = {
        row.figure: row
        for row in difference_table(compare_results(first, first + rng.normal(0, 0.5, first.shape)))
    }
    rms = rows["Depth, RMS difference"]
    assert rms.words == f"{rms.value} ± {rms.std}"
    assert float(rms.std) == pytest.approx(0.5 / np.sqrt(2 * first.size), rel=0.4)
    assert rows["Pixels that both have"].std == ""
