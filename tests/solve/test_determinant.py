from __future__ import annotations

import numpy as np
import pytest

from dsl_core.solve.determinant import log_determinant


@pytest.mark.parametrize("size", [1, 2, 7, 40])
def test_it_is_that_of_numpy_whatever_the_sign_and_left_as_it_was(size: int) -> None:
    matrix = np.random.default_rng(size).normal(size=(size, size))
    before = matrix.copy()
    assert log_determinant(matrix) == pytest.approx(np.linalg.slogdet(matrix)[1], abs=1e-9)
    assert log_determinant(-matrix) == pytest.approx(np.linalg.slogdet(matrix)[1], abs=1e-9)
    assert np.array_equal(matrix, before)
