from __future__ import annotations

import numpy as np
import pytest

from dsl_core.solve.normal import BAND_95, MEDIAN_OVER_MEAN_STD, STD_OF_MEDIAN_SIZE


def test_factors_are_what_drawn_values_show() -> None:
    drawn = np.random.default_rng(4).standard_normal((4000, 101))
    assert np.mean(np.abs(drawn) < BAND_95) == pytest.approx(0.95, abs=0.002)
    assert 1 / np.median(np.abs(drawn)) == pytest.approx(STD_OF_MEDIAN_SIZE, rel=0.01)
    ratio = np.median(drawn, axis=1).std() / drawn.mean(axis=1).std()
    assert ratio == pytest.approx(MEDIAN_OVER_MEAN_STD, rel=0.03)
