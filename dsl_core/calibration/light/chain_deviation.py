"""How far factors of the spectral chain may be off: by leaving out parts of the picture, scan by scan.

What the light does in a frame, a lamp's flicker or the projector's drift, all pixels of the same columns have
in common, so that parts above each other tell no more than one. And it is no property of a place: what places
differ by must show in every scan.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import reduce
from operator import add

import numpy as np
from numpy.typing import NDArray

from dsl_core.solve.smooth_functions import Equations, SmoothSolution, solve_given

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Part:
    """Equations of a part of the picture in one of several scans; parts of a ``column`` share frames."""

    scan: int
    row: int
    column: int
    equations: Equations


class LeftOut:
    """Solutions without some parts of the ``total`` equations, and how much of these each part is."""

    def __init__(self, solution: SmoothSolution, total: Equations, parts: Sequence[Part]) -> None:
        self._solution, self._total, self._parts = solution, total, parts
        self._without_one = self._without([[part] for part in parts])
        frames: dict[tuple[int, int], list[Part]] = {}
        for part in parts:
            frames.setdefault((part.scan, part.column), []).append(part)
        self._without_frames = self._without(list(frames.values()))

    def _without(self, groups: Sequence[Sequence[Part]]) -> Floats:
        """Values without each of some groups of parts, (groups, unknowns)."""
        left = (self._total - reduce(add, (part.equations for part in group)) for group in groups)
        prior, noise = self._solution.prior, self._solution.noise_factor
        return np.array([solve_given(each, prior, noise).values for each in left])

    def variance_of_mean(self, product: Floats) -> Floats:
        """Variance (n,) of combinations (n, unknowns) by leaving out frames (jackknife)."""
        values = self._without_frames @ product.T
        return np.asarray(values.var(0) * (len(values) - 1))

    def variance_of_place(self, product: Floats) -> Floats:
        """Variance (n,) of combinations (n, unknowns) from place to place of the picture.

        Of several scans by what they agree in, whose frames are others: from products of what a part of the
        picture says in different scans. Of a single one what parts differ by beyond their own noise.
        """
        if len({part.scan for part in self._parts}) == 1:
            values, count = self._without_one @ product.T, len(self._parts)
            posterior = np.einsum("ij,jk,ik->i", product, self._solution.covariance, product).clip(min=0)
            return np.asarray((values.var(0) * (count - 1) * count - posterior * count).clip(min=0))
        gain = product @ self._solution.covariance
        known = np.array([np.sum(gain @ part.equations.normal * gain, 1) for part in self._parts])
        share = known / np.maximum(known.sum(0), 1e-300)
        # A part that the solution rests on pulls it along.
        pull = (self._solution.values - self._without_one) @ product.T * (1 - share)
        found, weight = np.zeros(len(product)), np.zeros(len(product))
        for place in {(part.row, part.column) for part in self._parts}:
            here = [k for k, part in enumerate(self._parts) if (part.row, part.column) == place]
            found += pull[here].sum(0) ** 2 - (pull[here] ** 2).sum(0)
            weight += share[here].sum(0) ** 2 - (share[here] ** 2).sum(0)
        return np.asarray((found / np.maximum(weight, 1e-300)).clip(min=0))
