"""Merged real captures give the chart's spectrometer values."""

from __future__ import annotations

import numpy as np
import pytest

from tests.cases.bandpass_chart import FOLDER, WHITE, ChartComparison, compare, rms


@pytest.fixture(scope="module")
def chart() -> ChartComparison:
    if not FOLDER.is_dir():
        pytest.skip(f"real captures are not here: {FOLDER} (set DSL_SHARED)")
    return compare()


def test_overall_error_after_one_scale_per_patch(chart: ChartComparison) -> None:
    errors = chart.errors()
    assert errors.shape == (6, 24)
    assert rms(errors) <= 0.020  # wanted: 0.024
    assert rms(errors[:, :WHITE]) <= 0.022


def test_no_filter_is_left_behind(chart: ChartComparison) -> None:
    per_filter = np.sqrt((chart.errors() ** 2).mean(axis=1))
    np.testing.assert_array_less(per_filter, [0.012, 0.011, 0.022, 0.020, 0.017, 0.031])
    assert chart.channels == ["B", "G", "G", "R", "R", "R"]


def test_flat_field_from_the_board_helps(chart: ChartComparison) -> None:
    assert rms(chart.errors()) < 0.85 * rms(compare(with_flat_field=False).errors())
