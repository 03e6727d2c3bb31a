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


def pool(probe: Probe, design: Floats, prior_std: Floats, among: NDArray[np.bool_] | None = None) -> Pooled:
    """Fit values (k,) that the ``design`` (n, p, k) turns into parameters of the probe's pixels.

    ``prior_std`` (k,) is what each value may be off zero before any scan is seen; ``among`` (n,) are the
    pixels to use, all by default.
    """
    used = probe.sound if among is None else probe.sound & among
    part, weight = design[used], probe.weight[used]
    heavy = part * weight[:, None, None]
    score = np.einsum("npk,np->nk", heavy, probe.score[used])
    normal = np.einsum("npk,npq,nql->nkl", heavy, probe.normal[used], part, optimize=True)
    prior = prior_std**-2.0
    inverse = np.linalg.inv(normal.sum(0) + np.diag(prior))
    found = inverse @ score.sum(0)
    excess = _excess(score - normal @ found, normal, prior, probe.cell[used])
    return Pooled(found, inverse * excess, excess)


def _excess(left: Floats, normal: Floats, prior: Floats, cell: NDArray[np.intp]) -> float:
    ratios = []
    for index in np.unique(cell):
        here = cell == index
        asked, information = left[here].sum(0), normal[here].sum(0)
        solved = np.linalg.solve(information + np.diag(prior), asked)
        known = np.trace(np.linalg.solve(information + np.diag(prior), information))
        ratios.append(float(asked @ solved) / max(known, 1.0))
    return max(float(np.mean(ratios)), 1.0)
