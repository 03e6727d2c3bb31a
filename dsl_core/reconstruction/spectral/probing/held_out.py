"""Whether what some pixels of a picture ask of the model explains the frames of the others."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsl_core.reconstruction.spectral.probing.pooled import pool
from dsl_core.reconstruction.spectral.probing.probe import Probe
from dsl_core.reconstruction.spectral.probing.probed_pixels import CELLS

Floats = NDArray[np.float64]

#: Parts that the picture's cells are divided into; each is judged by a fit to the others.
FOLDS = 4
#: Fall of chi-square of the pixels held out, over the excess of their scatter, and in deviations over cells.
LEAST_FALL, FALL_SIGMAS = 25.0, 1.5


@dataclass(frozen=True)
class Hypothesis:
    """Numbers (k,), with their prior, that a ``design`` (n, p, k) turns into parameters of pixels."""

    design: Floats
    prior_std: Floats


def explains_others(probe: Probe, more: Hypothesis, less: Hypothesis) -> bool:
    """Whether ``more`` numbers, fitted to some cells of the picture, explain the others surely better.

    What a few cells alone ask for, an error of their own, explains no others.
    """
    fold = (probe.cell // CELLS[1] + probe.cell % CELLS[1]) % FOLDS
    fall, excess = np.zeros(CELLS[0] * CELLS[1]), 1.0
    for model, sign in ((more, 1), (less, -1)):
        for out in range(FOLDS):
            fit = pool(probe, model.design, model.prior_std, fold != out)
            here = probe.sound & (fold == out)
            asked = model.design[here] @ fit.values
            gained = 2 * (asked * probe.score[here]).sum(1)
            gained -= np.einsum("np,npq,nq->n", asked, probe.normal[here], asked)
            np.add.at(fall, probe.cell[here], sign * probe.weight[here] * gained)
            excess = max(excess, fit.excess) if sign > 0 else excess
    total = float(fall.sum())
    return total > LEAST_FALL * excess and total > FALL_SIGMAS * float(np.linalg.norm(fall))
