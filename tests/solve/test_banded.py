"""Banded systems against dense linear algebra."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from torch import Tensor

from dsl_core.solve import banded

SYSTEMS = 6


def positive(bandwidth: int, unknowns: int) -> Tensor:
    """Random positive definite banded systems: random bands, dominated by the diagonal."""
    generator = torch.Generator().manual_seed(bandwidth)
    matrix = torch.rand((bandwidth + 1, unknowns, SYSTEMS), generator=generator, dtype=torch.float64) - 0.5
    for o in range(1, bandwidth + 1):
        matrix[o, unknowns - o :] = 0
    matrix[0] = 1.0 + bandwidth + matrix[0]
    return matrix


@pytest.fixture(params=[(1, 7), (3, 12), (6, 20), (4, 5)], ids=str)
def matrix(request: pytest.FixtureRequest) -> Tensor:
    return positive(*request.param)


def test_solution_is_that_of_dense_algebra(matrix: Tensor) -> None:
    right = torch.rand(matrix.shape[1:], generator=torch.Generator().manual_seed(9), dtype=torch.float64)
    expected = np.linalg.solve(banded.to_dense(matrix).numpy(), right.T.numpy()[..., None])[..., 0]
    found = banded.solve(banded.factorise(matrix), right)
    assert np.abs(found.T.numpy() - expected).max() < 1e-12
    assert (banded.multiply(matrix, found) - right).abs().max() < 1e-12


def test_several_right_sides_are_solved_alike(matrix: Tensor) -> None:
    unknowns = matrix.shape[1]
    right = torch.rand(
        (unknowns, 3, SYSTEMS), generator=torch.Generator().manual_seed(2), dtype=torch.float64
    )
    factor = banded.factorise(matrix)
    together = banded.solve(factor, right)
    for i in range(3):
        assert (together[:, i] - banded.solve(factor, right[:, i].contiguous())).abs().max() < 1e-14


def test_inverse_inside_the_band_is_the_dense_one(matrix: Tensor) -> None:
    inverse = np.linalg.inv(banded.to_dense(matrix).numpy())
    found = banded.inverse_band(banded.factorise(matrix)).numpy()
    for o in range(matrix.shape[0]):
        for j in range(matrix.shape[1] - o):
            assert found[o, j] == pytest.approx(inverse[:, j, j + o], abs=1e-12)


def test_log_determinant_is_the_dense_one(matrix: Tensor) -> None:
    expected = np.linalg.slogdet(banded.to_dense(matrix).numpy())[1]
    assert banded.factorise(matrix).log_determinant.numpy() == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("value", [-1.0, 0.0, np.nan, np.inf])
def test_a_system_that_is_not_positive_is_refused(value: float) -> None:
    matrix = positive(2, 6)
    matrix[0, 3, 1] = value
    with pytest.raises(ValueError, match="not positive definite"):
        banded.factorise(matrix)


def test_a_band_of_nothing_but_the_diagonal_has_its_inverse() -> None:
    matrix = torch.tensor([[[2.0], [4.0], [0.5]]], dtype=torch.float64)
    assert banded.inverse_band(banded.factorise(matrix)).tolist() == [[[0.5], [0.25], [2.0]]]
