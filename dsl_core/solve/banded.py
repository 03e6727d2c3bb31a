"""Symmetric positive definite banded systems, many small ones at once.

Storage: ``matrix[o, j, p]`` is element (j, j + o) of system p, so a batch has shape
(bandwidth + 1, unknowns, systems) and every step works on contiguous systems.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

NOT_DEFINITE = "a banded system is not positive definite; its weights or prior are not positive"


@dataclass(frozen=True)
class Factor:
    """``L D L'`` of a batch: ``lower[o - 1, j]`` is L's element (j + o, j), ``diagonal[j]`` is D's."""

    lower: Tensor
    diagonal: Tensor

    @property
    def log_determinant(self) -> Tensor:
        """Logarithm of each system's determinant, shape (systems,)."""
        return torch.log(self.diagonal).sum(0)


def factorise(matrix: Tensor, overwrite: bool = False) -> Factor:
    """Factorise a batch; raises ``ValueError`` unless every system is positive definite.

    With ``overwrite`` the matrix is used up, which saves a copy.
    """
    bandwidth, unknowns = matrix.shape[0] - 1, matrix.shape[1]
    work = matrix if overwrite else matrix.clone()
    lower = torch.zeros_like(matrix[1:]) if bandwidth else matrix[:0]
    for j in range(unknowns):
        reach = min(bandwidth, unknowns - 1 - j)
        if reach == 0:
            continue
        column = work[1 : reach + 1, j]
        torch.div(column, work[0, j], out=lower[:reach, j])
        for a in range(1, reach + 1):
            work[: reach - a + 1, j + a].addcmul_(lower[a - 1, j], work[a : reach + 1, j], value=-1)
    # NaN fails both comparisons; infinity would leave zeros behind instead of an answer.
    if not bool(((work[0] > 0) & (work[0] < torch.inf)).all()):
        raise ValueError(NOT_DEFINITE)
    return Factor(lower, work[0])


def solve(factor: Factor, right: Tensor) -> Tensor:
    """Solutions of a batch; ``right`` is (unknowns, systems) or (unknowns, columns, systems)."""
    return solve_upper(factor, solve_lower(factor, right))


def solve_lower(factor: Factor, right: Tensor) -> Tensor:
    """Solutions ``z`` of ``L z = right``, the first half of `solve`; shapes as there.

    The quadratic form of the inverse is ``sum(z**2 / D)``, without the second half.
    """
    z = right.clone()
    bandwidth, unknowns = factor.lower.shape[0], factor.diagonal.shape[0]
    lower = _for_columns(factor.lower, right)
    for j in range(unknowns - 1):
        reach = min(bandwidth, unknowns - 1 - j)
        z[j + 1 : j + 1 + reach].addcmul_(lower[:reach, j], z[j], value=-1)
    return z


def solve_upper(factor: Factor, right: Tensor) -> Tensor:
    """Solutions ``x`` of ``D L' x = right``, the second half of `solve`; shapes as there."""
    bandwidth, unknowns = factor.lower.shape[0], factor.diagonal.shape[0]
    lower = _for_columns(factor.lower, right)
    x = right / _for_columns(factor.diagonal, right)
    for j in range(unknowns - 2, -1, -1):
        reach = min(bandwidth, unknowns - 1 - j)
        x[j] -= (lower[:reach, j] * x[j + 1 : j + 1 + reach]).sum(0)
    return x


def _for_columns(values: Tensor, right: Tensor) -> Tensor:
    """Values (..., systems) with an axis for the columns of a right side that has one."""
    return values if right.ndim == 2 else values.unsqueeze(-2)


def inverse_band(factor: Factor) -> Tensor:
    """Elements of the inverse inside the band, stored like the matrix (Takahashi's recursion).

    ``block`` holds those between the ``bandwidth`` unknowns after j; unknown k has row and column k modulo
    bandwidth, so that nothing moves from one j to the next.
    """
    bandwidth, unknowns = factor.lower.shape[0], factor.diagonal.shape[0]
    inverse = factor.diagonal.new_zeros((bandwidth + 1, *factor.diagonal.shape))
    if bandwidth == 0:
        inverse[0] = 1 / factor.diagonal
        return inverse
    block = factor.lower.new_zeros((bandwidth, bandwidth, factor.diagonal.shape[1]))
    for j in range(unknowns - 1, -1, -1):
        low = factor.lower[:, j].roll(j + 1, 0)
        # Z[j, k] = -sum_i L[i, j] Z[i, k]
        row = torch.zeros_like(low)
        for i in range(bandwidth):
            row.addcmul_(block[i], low[i], value=-1)
        inverse[0, j] = 1 / factor.diagonal[j] - (low * row).sum(0)
        inverse[1:, j] = row.roll(-j - 1, 0)
        row[j % bandwidth] = inverse[0, j]
        block[j % bandwidth] = block[:, j % bandwidth] = row
    return inverse


def multiply(matrix: Tensor, x: Tensor) -> Tensor:
    """Product of each system's matrix with its vector, (unknowns, systems)."""
    unknowns = matrix.shape[1]
    out = matrix[0] * x
    for o in range(1, matrix.shape[0]):
        out[: unknowns - o].addcmul_(matrix[o, : unknowns - o], x[o:])
        out[o:].addcmul_(matrix[o, : unknowns - o], x[: unknowns - o])
    return out


def to_dense(matrix: Tensor) -> Tensor:
    """Full matrices, shape (systems, unknowns, unknowns)."""
    unknowns, systems = matrix.shape[1:]
    dense = torch.zeros((systems, unknowns, unknowns), dtype=matrix.dtype, device=matrix.device)
    for o in range(matrix.shape[0]):
        j = torch.arange(unknowns - o)
        dense[:, j, j + o] = matrix[o, : unknowns - o].T
        dense[:, j + o, j] = matrix[o, : unknowns - o].T
    return dense
