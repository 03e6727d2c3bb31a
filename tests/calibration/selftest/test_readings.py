"""Rows of readings stay together, and lines through them have honest deviations."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.calibration.selftest.readings import joined, line_fit
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
