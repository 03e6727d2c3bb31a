"""Rows of readings stay together, and lines through them have honest deviations."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.calibration.selftest.readings import RegionSizes, joined, line_fit
from tests.cases.cycle_readings import table


def test_a_line_has_the_deviation_of_its_noise_or_of_its_scatter() -> None:
    rng, x = np.random.default_rng(0), np.linspace(0, 1, 200)
    design = np.stack([np.ones_like(x), x], 1)
    values = 3 + 2 * x + 0.1 * rng.standard_normal(200)
    found, covariance = line_fit(design, values, np.full(200, 0.1))
    assert found == pytest.approx([3, 2], abs=0.1)
    assert np.sqrt(covariance[1, 1]) == pytest.approx(0.1 / np.sqrt(200) / x.std(), rel=0.1)
    # Stated ten times too small: the residuals tell.
    _, wider = line_fit(design, values, np.full(200, 0.01))
    assert wider == pytest.approx(covariance, rel=0.15)


def test_rows_are_chosen_and_joined_in_all_columns() -> None:
    readings = table(np.arange(4.0), np.arange(12.0).reshape(4, 3), np.arange(4.0) / 1000)
    part = readings[np.array([2, 0])]
    assert part.exposure_ms.tolist() == [2.0, 0.0]
    assert part.mean_dn[0].tolist() == [6.0, 7.0, 8.0]
    both = joined(part, readings)
    assert len(both) == 6
    assert both.timestamp_s.tolist() == [0.002, 0.0, 0.0, 0.001, 0.002, 0.003]


def test_coefficients_and_covariance_are_those_of_weighted_least_squares() -> None:
    x, std = np.array([0.0, 1.0, 2.0]), np.array([0.1, 0.2, 0.1])
    found, covariance = line_fit(np.stack([np.ones(3), x], 1), np.array([1.0, 3.0, 5.0]), std)
    assert found == pytest.approx([1.0, 2.0])
    w = std**-2
    normal = np.array([[w.sum(), w @ x], [w @ x, w @ x**2]])
    assert covariance == pytest.approx(np.linalg.inv(normal))
    # One value more than unknowns: the chi-square itself is how much wider.
    off = np.array([1.0, 3.0 + 2.0, 5.0])
    again, wider = line_fit(np.stack([np.ones(3), x], 1), off, std)
    chi2 = float((((off - again[0] - again[1] * x) / std) ** 2).sum())
    assert wider == pytest.approx(covariance * chi2)
    exact, as_stated = line_fit(np.ones((1, 1)), np.array([4.0]), np.array([0.5]))
    assert (exact[0], as_stated[0, 0]) == (pytest.approx(4.0), pytest.approx(0.25))


def test_a_picture_clips_from_two_pixels_in_ten_thousand_on() -> None:
    readings = table(np.arange(2.0), np.zeros((2, 3)))
    readings.clipped[0] = 1.9e-4, 2.1e-4, 0.0
    assert readings.unclipped.tolist() == [[True, False, True], [True, True, True]]
    assert RegionSizes(np.ones(3, np.int64), np.ones(3, np.int64), 10).full_scale_dn == 1023.0
