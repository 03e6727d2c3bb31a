"""How the projector's light falls from the middle of its frame to the sides, as a scan itself shows it.

Each pixel receives its bands from lines left and right of its own column. Where the light falls to the sides,
one order is brighter than the zero order says and the other darker, by how far from the middle their lines
are: over the picture, gains of the orders follow a parabola of the frame's columns, as nothing else makes
them. The gain of a camera is the same for all light of a pixel and does not show.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dsl_core.model.fit import matters
from dsl_core.reconstruction.spectral.probing.cell_sums import CellSums
from dsl_core.reconstruction.spectral.probing.held_out import Hypothesis, explains_others
from dsl_core.reconstruction.spectral.probing.probe import LEADING, PRIOR_STD, Probe

#: What the light may change by before any scan is seen, and a change to the sides that matters.
UNEVEN_STD, MOST_UNEVEN = 0.3, 0.04
#: Of `LEADING` parameters the first two are places, the next two the gains of the orders.
_GAINS = slice(2, 4)


@dataclass(frozen=True)
class Evenness:
    """``change`` of the light from the middle of the frame to its left and right, with its deviation.

    ``error`` is what it puts reflectances off by, relative, root mean square over pixels and bands.
    ``matters`` is whether that is much, no chance, and explains pixels that the fit has not seen.
    """

    change: float
    std: float
    error: float
    matters: bool


def fit_evenness(probe: Probe) -> Evenness | None:
    """The evenness that all probed pixels ask for; None of a probe that nobody traced lines for."""
    if probe.sideways is None:
        return None
    rest = LEADING - 2
    design = np.zeros((*probe.score.shape, 1 + rest))
    design[:, _GAINS, 0] = probe.sideways
    design[:, 2:LEADING, 1:] = np.eye(rest)
    prior_std = np.r_[UNEVEN_STD, PRIOR_STD[2:LEADING]]
    asked = Hypothesis(CellSums.of(probe, design), prior_std)
    fit = asked.sums.fit(prior_std)
    change, std = float(fit.values[0]), float(np.sqrt(fit.covariance[0, 0]))
    error = abs(change) * float(np.sqrt(np.mean(probe.sideways**2)))
    if not matters(change, std, MOST_UNEVEN):
        return Evenness(change, std, error, False)
    return Evenness(change, std, error, explains_others(asked, 1))
