"""The spectral solver against arithmetic of 106 bits, and that arithmetic against fractions."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
import torch

from dsl_core.reconstruction.spectral.solving.prior import Prior
from tests.stability.double_double import Wide
from tests.stability.exact_solution import System, exact_nodes
from tests.stability.exactness import exactness

#: Errors allowed: of nodes, relative, free and at a bound; and in stated deviations, free and at a bound.
ALLOWED = {torch.float32: ((0.03, 0.03), (1.0, 1.0)), torch.float64: ((1e-9, 2e-3), (1e-6, 0.1))}


def _fraction(value: Wide, index: int) -> Fraction:
    return Fraction(float(value.high[index])) + Fraction(float(value.low[index]))


def test_double_doubles_keep_a_hundred_bits() -> None:
    rng = np.random.default_rng(0)
    a, b, c = (
        Wide(x, x * rng.uniform(-1, 1, 50) * 2.0**-54)
        for x in rng.uniform(0.5, 2, (3, 50)) * 10.0 ** rng.integers(-9, 9, (3, 50))
    )
    for i in range(50):
        x, y, z = (_fraction(value, i) for value in (a, b, c))
        for found, exact in ((a + b, x + y), (a * b, x * y), (a / b, x / y), (a * b + c, x * y + z)):
            assert abs(_fraction(found, i) / exact - 1) < Fraction(1, 2**100)
        assert abs(_fraction(a * b - c, i) - (x * y - z)) < (abs(x * y) + abs(z)) * Fraction(1, 2**100)


def _exact_by_fractions(system: System, tau: float, prior: Prior) -> list[Fraction]:
    """The free solution of the first pixel, by Gauss's elimination in fractions."""
    n = system.bands
    matrix = [[Fraction(0)] * (n + 1) for _ in range(n)]
    ridge = 1 / Fraction(prior.level_std) ** 2
    for j in range(n):
        for o in range(len(system.data)):
            if j + o < n:
                matrix[j][j + o] += Fraction(float(system.data[o, j, 0]))
                matrix[j + o][j] += Fraction(float(system.data[o, j, 0])) if o else 0
        for i in range(n):
            matrix[i][j] += sum(
                Fraction(float(row[i])) * Fraction(float(row[j])) for row in system.rows[:, :, 0].T
            )
        matrix[j][j] += ridge
        matrix[j][n] = Fraction(float(system.right[j, 0])) + ridge * Fraction(prior.level)
    for i in range(n - 2):
        for a, u in enumerate((1, -2, 1)):
            for b, v in enumerate((1, -2, 1)):
                matrix[i + a][i + b] += Fraction(u * v) / Fraction(tau) ** 2
    for j in range(n):
        for i in range(j + 1, n):
            factor = matrix[i][j] / matrix[j][j]
            matrix[i] = [x - factor * y for x, y in zip(matrix[i], matrix[j], strict=True)]
    x = [Fraction(0)] * n
    for j in range(n - 1, -1, -1):
        known = sum((matrix[j][i] * x[i] for i in range(j + 1, n)), Fraction(0))
        x[j] = (matrix[j][n] - known) / matrix[j][j]
    return x


def test_the_reference_is_exact() -> None:
    rng = np.random.default_rng(4)
    bands, prior = 12, Prior()
    data = np.zeros((4, bands, 1))
    data[0], data[1:] = rng.uniform(1, 2, (bands, 1)), rng.uniform(-0.2, 0.2, (3, bands, 1))
    for o in range(1, 4):
        data[o, bands - o :] = 0
    system = System(data * 1e5, rng.uniform(0, 1e5, (bands, 1)), rng.uniform(0, 30, (bands, 3, 1)))
    tau = 0.0085
    free = np.zeros((bands, 1), bool)
    found = exact_nodes(system, np.array([tau]), prior, free, free.astype(float))[:, 0]
    exact = [float(x) for x in _exact_by_fractions(system, tau, prior)]
    assert found == pytest.approx(exact, rel=1e-15)


@pytest.mark.slow
@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_the_solver_agrees_with_exact_arithmetic(dtype: torch.dtype) -> None:
    found = exactness(400, 11, dtype)
    for bound in (False, True):
        chosen = found.at_bound == bound
        relative, sigmas = (limits[int(bound)] for limits in ALLOWED[dtype])
        assert chosen.sum() > 50
        assert found.relative[chosen].max() < relative
        assert found.sigmas[chosen].max() < sigmas
    assert np.median(found.sigmas) < (5e-3 if dtype == torch.float32 else 1e-6)
