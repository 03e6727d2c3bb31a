"""Smooth functions from data that are linear in them, as smooth as the data say.

Each function is a Gaussian process on nodes: a level, a slope, and a Matern 5/2 process whose amplitude and
length maximise the evidence of the data (Rasmussen and Williams, *Gaussian Processes for Machine Learning*,
Eq. 5.8; the integrated likelihood of linear models). Data enter as normal equations, so that their number
does not matter. The noise may be larger than stated: its factor is chosen by the same evidence.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

#: Lengths (units of the nodes) and amplitudes that are tried where nothing else is asked for.
LENGTHS = (15.0, 30.0, 60.0, 120.0, 240.0)
AMPLITUDES = (0.001, 0.003, 0.01, 0.03, 0.1, 0.3)
#: Factors of the stated noise that are tried.
NOISE_FACTORS = (1.0, 1.4, 2.0, 2.8, 4.0, 5.6, 8.0, 16.0, 32.0, 64.0)


def hat_functions(at: Floats, nodes: Floats) -> Floats:
    """Share of each node in the value at each place by linear interpolation, (places, nodes)."""
    return np.stack([np.interp(at, nodes, unit) for unit in np.eye(len(nodes))], 1)


@dataclass(frozen=True)
class SmoothPrior:
    """One function: its nodes (rising), and what its level and its rise over all nodes may be."""

    nodes: Floats
    level_std: float
    rise_std: float

    def covariance(self, amplitude: float, length: float) -> Floats:
        """Covariance of the values at the nodes, (nodes, nodes)."""
        x = (self.nodes - self.nodes.mean()) / max(float(np.ptp(self.nodes)), 1e-12)
        trend = self.level_std**2 + self.rise_std**2 * np.outer(x, x)
        return np.asarray(trend + amplitude**2 * matern(np.subtract.outer(self.nodes, self.nodes) / length))


@dataclass(frozen=True)
class Equations:
    """Weighted normal equations: ``normal`` (n, n), ``right`` (n,), the data's sum of squares and number."""

    normal: Floats
    right: Floats
    square: float
    count: int

    @classmethod
    def of(cls, design: Floats, values: Floats, std: Floats) -> Equations:
        """From independent data ``values = design @ x`` (data, n) of deviation ``std``."""
        weighted = design / std[:, None]
        scaled = values / std
        return cls(weighted.T @ weighted, weighted.T @ scaled, float(scaled @ scaled), len(values))

    def __add__(self, other: Equations) -> Equations:
        return Equations(
            self.normal + other.normal,
            self.right + other.right,
            self.square + other.square,
            self.count + other.count,
        )

    def __sub__(self, other: Equations) -> Equations:
        return self + Equations(-other.normal, -other.right, -other.square, -other.count)


@dataclass(frozen=True)
class SmoothSolution:
    """Most likely values (n,) and their covariance (n, n), and what the evidence chose."""

    values: Floats
    covariance: Floats
    noise_factor: float
    prior: Floats
    log_evidence: float

    @property
    def std(self) -> Floats:
        """Standard deviations of the values, (n,)."""
        return np.sqrt(np.maximum(np.diag(self.covariance), 0.0))


def matern(distance: Floats) -> Floats:
    """Matern correlation of smoothness 5/2 at a distance in units of its length, same shape."""
    d = np.sqrt(5.0) * np.abs(distance)
    return np.asarray((1 + d + d**2 / 3) * np.exp(-d))


def solve_smooth(
    equations: Equations,
    functions: Sequence[SmoothPrior],
    others_std: Sequence[float] = (),
    *,
    amplitudes: Sequence[float] = AMPLITUDES,
    lengths: Sequence[float] = LENGTHS,
    noise_factors: Sequence[float] = NOISE_FACTORS,
) -> SmoothSolution:
    """Functions, one after the other, then single unknowns of given prior deviation, from their equations."""
    priors = (
        _prior(functions, others_std, amplitude, length) for length in lengths for amplitude in amplitudes
    )
    found = (solve_given(equations, prior, factor) for prior in priors for factor in noise_factors)
    return max(found, key=lambda solution: solution.log_evidence)


def solve_given(equations: Equations, prior: Floats, noise_factor: float) -> SmoothSolution:
    """Solve with a given prior covariance, which may be singular, and factor of the stated noise."""
    precision = 1 / noise_factor**2
    system = np.eye(len(prior)) + prior @ equations.normal * precision
    covariance = np.linalg.solve(system, prior)
    covariance = 0.5 * (covariance + covariance.T)
    values = covariance @ equations.right * precision
    explained = float(values @ equations.right) * precision
    misfit = equations.square * precision - explained
    log_evidence = -0.5 * (log_determinant(system) + misfit + 2 * equations.count * np.log(noise_factor))
    return SmoothSolution(values, covariance, noise_factor, prior, float(log_evidence))


def _prior(
    functions: Sequence[SmoothPrior], others_std: Sequence[float], amplitude: float, length: float
) -> Floats:
    from scipy.linalg import block_diag

    blocks = [function.covariance(amplitude, length) for function in functions]
    return np.asarray(
        block_diag(*blocks, np.diag(np.square(others_std)) if len(others_std) else np.empty((0, 0)))
    )


def log_determinant(matrix: NDArray[np.float64]) -> float:
    """Natural logarithm of the size of the determinant of a matrix (n, n).

    numpy's holds Python's lock while it computes, which stops a window that lives in the same program.
    """
    from scipy.linalg.lapack import dgetrf

    triangles, _, _ = dgetrf(matrix)
    return float(np.log(np.abs(np.diag(triangles))).sum())
