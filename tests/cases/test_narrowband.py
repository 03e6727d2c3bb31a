"""Filters, weighted means and flat fields do what their formulas say."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.errors import DecodeError
from dsl_core.model.spectral import SpectralCurve
from tests.cases.narrowband import band_means, centroid_nm, flat_field, pass_band

GRID_NM = np.arange(350.0, 901.0)


def test_pass_band_drops_what_is_far_or_faint() -> None:
    band = np.exp(-0.5 * ((GRID_NM - 546) / 4) ** 2)
    noise = 0.3 * (GRID_NM < 390) + 2.0 * (GRID_NM > 800)
    cut = pass_band(SpectralCurve.of(GRID_NM, band + noise + 0.004))
    values = np.array(cut.values)
    assert centroid_nm(cut) == pytest.approx(546, abs=0.01)
    assert values[np.abs(GRID_NM - 546) > 12].max() == 0
    assert values.max() == pytest.approx(1.004)


def test_band_means_of_lines_are_their_values_at_the_centroid() -> None:
    band = SpectralCurve.of([500.0, 510.0, 530.0], [0.0, 2.0, 0.0])
    spectra = np.stack([GRID_NM, 3 - 0.01 * GRID_NM], axis=1)
    centre = np.average(GRID_NM, weights=np.interp(GRID_NM, [500, 510, 530], [0, 2, 0]))
    np.testing.assert_allclose(band_means(GRID_NM, spectra, band), [centre, 3 - 0.01 * centre])
    assert centre == pytest.approx((500 + 510 + 530) / 3, abs=0.05)


def test_flat_field_continues_under_what_it_cannot_see() -> None:
    rng = np.random.default_rng(0)
    y, x = np.mgrid[-1:1:60j, -1:1:80j]
    truth = np.exp(0.3 * x - 0.2 * y + 0.25 * x * y - 0.3 * x**2)
    seen = truth * rng.normal(1, 0.02, truth.shape)
    uniform = (np.abs(x) > 0.6) | (y > 0.5)
    seen[~uniform] = 17.0
    seen[uniform & (rng.random(truth.shape) < 0.05)] *= 0.3
    seen[0, 0] = np.nan
    found = flat_field(seen, uniform)
    expected = truth / truth[uniform].mean()
    np.testing.assert_allclose(found, expected, rtol=0.01)
    # One order less cannot follow the curvature.
    assert np.abs(flat_field(seen, uniform, order=1) / expected - 1).max() > 0.1


def test_flat_field_needs_pixels() -> None:
    with pytest.raises(DecodeError, match="Only 5 pixels"):
        flat_field(np.ones((10, 10)), np.arange(100).reshape(10, 10) < 5)
