"""The spectral solver against the exact reference: how far its answers are from those of 106 bits."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray

from dsl_core.reconstruction.spectral.solving.lane_solver import solve_spectra
from dsl_core.reconstruction.spectral.solving.prior import Prior
from tests.stability.double_double import Floats
from tests.stability.exact_solution import exact_nodes, exact_tau
from tests.stability.random_pixels import random_equations, widened


@dataclass(frozen=True)
class Exactness:
    """Errors of each pixel (pixels,), and whether a band of it is at a bound.

    ``relative`` is the largest error of a node over the largest node, with the solver's own smoothness;
    ``tau`` the relative error of that; ``sigmas`` the largest error over the stated deviation, smoothness and
    all; ``condition`` the condition number of the equations as they are solved.
    """

    relative: Floats
    tau: Floats
    sigmas: Floats
    at_bound: NDArray[np.bool_]

    @classmethod
    def joined(cls, parts: list[Exactness]) -> Exactness:
        """All pixels of some batches."""
        return cls(
            *(
                np.concatenate([getattr(part, name) for part in parts])
                for name in ("relative", "tau", "sigmas", "at_bound")
            )
        )


def exactness(count: int, seed: int, dtype: torch.dtype) -> Exactness:
    """Solve random pixels in a precision and exactly."""
    prior = Prior()
    equations = random_equations(count, seed, dtype)
    found = solve_spectra(*equations, prior)
    system, low, high = widened(equations), *prior.bounds
    nodes, std = found.nodes.double().numpy(), found.std.double().numpy()
    pinned = found.at_bound.numpy()
    values = np.where(nodes < 0.5 * (low + high), low, high)
    tau = found.tau.double().numpy()
    same = exact_nodes(system, tau, prior, pinned, values).clip(low, high)
    best = exact_tau(system, prior)
    exact = exact_nodes(system, best, prior, pinned, values).clip(low, high)
    scale = np.maximum(np.abs(same).max(0), 1e-3)
    return Exactness(
        np.abs(nodes - same).max(0) / scale,
        np.abs(tau / best - 1),
        (np.abs(nodes - exact) / std).max(0),
        np.asarray(pinned.any(0)),
    )
