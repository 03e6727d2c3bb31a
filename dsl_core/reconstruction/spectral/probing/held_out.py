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
    """Values (k,) by their prior, and what the cells of a picture ask of them."""

    sums: CellSums
    prior_std: Floats


def explains_others(asked: Hypothesis, first: int, least_fall: float = LEAST_FALL) -> bool:
    """Whether the ``first`` values, fitted to some cells of the picture, explain the others surely better.

    Better than the values after them do alone, by ``least_fall`` of chi-square. What a few cells ask for, an
    error of their own, explains no others.
    """
    rest, rest_std = asked.sums.tail(first), asked.prior_std[first:]
    cell = asked.sums.cell
    fold = (cell // CELLS[1] + cell % CELLS[1]) % FOLDS
    fall, excess = np.zeros(len(cell)), 1.0
    for out in range(FOLDS):
        here = fold == out
        fit, without = asked.sums.fit(asked.prior_std, ~here), rest.fit(rest_std, ~here)
        fall[here] = (asked.sums.falls(fit.values) - rest.falls(without.values))[here]
        excess = max(excess, fit.excess)
    total = float(fall.sum())
    return total > least_fall * excess and total > FALL_SIGMAS * float(np.linalg.norm(fall))
