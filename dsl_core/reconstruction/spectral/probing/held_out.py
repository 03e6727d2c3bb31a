"""Whether what some pixels of a picture ask of the model explains the frames of the others."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsl_core.reconstruction.spectral.probing.cell_sums import CellSums
from dsl_core.reconstruction.spectral.probing.probed_pixels import CELLS

Floats = NDArray[np.float64]

#: Parts that the picture's cells are divided into; each is judged by a fit to the others.
FOLDS = 4
#: Fall of chi-square of the pixels held out, over the excess of their scatter, and in deviations over cells.
LEAST_FALL, FALL_SIGMAS = 25.0, 1.5


@dataclass(frozen=True)
class Hypothesis:
    """Numbers (k,), with their prior, and what the cells of a picture ask of them."""

    sums: CellSums
    prior_std: Floats


def explains_others(more: Hypothesis, less: Hypothesis) -> bool:
    """Whether ``more`` numbers, fitted to some cells of the picture, explain the others surely better.

    Both are of the same pixels. What a few cells alone ask for, an error of their own, explains no others.
    """
    cell = more.sums.cell
    fold = (cell // CELLS[1] + cell % CELLS[1]) % FOLDS
    fall, excess = np.zeros(len(cell)), 1.0
    for out in range(FOLDS):
        here = fold == out
        fit = more.sums.fit(more.prior_std, ~here)
        other = less.sums.fit(less.prior_std, ~here)
        fall[here] = (more.sums.falls(fit.values) - less.sums.falls(other.values))[here]
        excess = max(excess, fit.excess)
    total = float(fall.sum())
    return total > LEAST_FALL * excess and total > FALL_SIGMAS * float(np.linalg.norm(fall))
