"""Normal equations of a window are those of weighted least squares over its pixels and bits."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.calibration.geometry.window_sums import normal_equations


def test_normal_equations_are_those_of_pixels_and_bits_that_are_no_outliers() -> None:
    rng = np.random.default_rng(3)
    samples, bits, pixels, oversample = 160, 3, 12, 16
    values, slopes = rng.uniform(-1, 1, (samples, bits)), rng.uniform(-1, 1, (samples, bits))
    terms = np.column_stack([np.ones(pixels), rng.uniform(-1, 1, (pixels, 5))])
    start = np.array([4.0, 2.0, 0.5, 0.1, -0.2, 0.3])
    start_far = np.array([-3.0, 12.0, 0.0, 0.0, 0.0, 0.0])
    contrast, weight = rng.uniform(-1, 1, (bits, pixels)).T, rng.uniform(0.5, 2.0, pixels)
    weight[3] = 0.0
    sigma, strength = np.array([0.3, 0.4, 0.5]), 0.8
    for course in (start, start_far):
        position = ((terms @ course + 0.5) * oversample - 0.5).clip(0, samples - 1 - 1e-6)
        whole = position.astype(int)
        part = (position - whole)[:, None]
        value = values[whole] * (1 - part) + values[whole + 1] * part
        slope = strength * (slopes[whole] * (1 - part) + slopes[whole + 1] * part)
        residual = contrast - strength * value
        near = np.abs(residual) * np.sqrt(weight)[:, None] <= 2.0 * sigma
        assert near.any()
        assert not near.all()
        each = near * weight[:, None] / sigma**2
        information, pull = (each * slope**2).sum(1), (each * slope * residual).sum(1)
        square, right, informed = normal_equations(
            terms, course, contrast, weight, values, slopes, oversample, strength, sigma, 2.0
        )
        assert square == pytest.approx(terms.T @ (information[:, None] * terms))
        assert right == pytest.approx(terms.T @ pull)
        assert informed == (information > 0).sum()
        assert informed < pixels
