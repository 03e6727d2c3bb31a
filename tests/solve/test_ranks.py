"""Medians and quantiles are those of NumPy, to the bit."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.solve.ranks import median, quantile


@pytest.mark.parametrize("count", [1, 2, 3, 4, 61, 62, 63, 64, 1999, 2000, 2001, 2002])
def test_ranks_are_those_of_numpy(count: int) -> None:
    rng = np.random.default_rng(count)
    for values in (rng.normal(300, 40, count), rng.integers(0, 9, count)):
        numbers = values.astype(np.float32)
        before = numbers.copy()
        assert median(numbers) == np.median(numbers)
        for share in (0.0, 0.1, 0.25, 0.5, 0.9, 1.0):
            assert quantile(numbers, share) == np.quantile(numbers, share), share
        np.testing.assert_array_equal(numbers, before)
