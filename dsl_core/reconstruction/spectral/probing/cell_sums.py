"""One fit to what all probed pixels say together."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsl_core.reconstruction.spectral.probing.probe import Probe

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Pooled:
    """``values`` (k,) of a fit and their ``covariance`` (k, k) by the scatter over cells.

    ``excess`` is by how much what cells ask for scatters more than their noise does: at least 1.
    """

    values: Floats
    covariance: Floats
    excess: float


@dataclass(frozen=True)
class CellSums:
    """What the sound pixels of each cell ask of some values (k,): all that any fit of them needs to know.

    ``cell`` (c,) are the cells that have such pixels; ``score`` (c, k) and ``normal`` (c, k, k) are the
    equations, weighted as the pixels are.
    """

    cell: NDArray[np.intp]
    score: Floats
    normal: Floats

    @classmethod
    def of(cls, probe: Probe, design: Floats) -> CellSums:
        """The sums for values that a ``design`` (n, p, k) turns into parameters of the probe's pixels."""
        used, count = probe.sound, design.shape[2]
        part = design[used]
        heavy = part * probe.weight[used, None, None]
        score = np.einsum("npk,np->nk", heavy, probe.score[used])
        normal = heavy.mT @ (probe.normal[used] @ part)
        cell, index = np.unique(probe.cell[used], return_inverse=True)
        mine = (index == np.arange(len(cell))[:, None]).astype(float)
        return cls(cell, mine @ score, (mine @ normal.reshape(len(part), -1)).reshape(-1, count, count))

    def tail(self, first: int) -> CellSums:
        """The same for the values from the ``first`` on, without those before it."""
        return CellSums(self.cell, self.score[:, first:], self.normal[:, first:, first:])

    def fit(self, prior_std: Floats, among: NDArray[np.bool_] | None = None) -> Pooled:
        """The values that fit best; ``prior_std`` (k,) is what each may be off zero before any scan is seen.

        ``among`` (c,) are the cells to use, all by default.
        """
        used = slice(None) if among is None else among
        score, normal = self.score[used], self.normal[used]
        prior = np.diag(prior_std**-2.0)
        inverse = np.linalg.inv(normal.sum(0) + prior)
        found = inverse @ score.sum(0)
        asked = score - normal @ found
        solved = np.linalg.solve(normal + prior, np.concatenate([asked[..., None], normal], 2))
        known = np.trace(solved[..., 1:], axis1=1, axis2=2)
        ratios = (asked * solved[..., 0]).sum(1) / np.maximum(known, 1.0)
        excess = max(float(ratios.mean()), 1.0) if len(ratios) else 1.0
        return Pooled(found, inverse * excess, excess)

    def falls(self, values: Floats) -> Floats:
        """By how much ``values`` (k,) lower the weighted squares that each cell (c,) leaves."""
        fall: Floats = 2 * self.score @ values - np.einsum("k,ckl,l->c", values, self.normal, values)
        return fall
