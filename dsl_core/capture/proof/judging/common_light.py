"""Whether a picture of many lines has gained light in all pixels: a lamp of the room, and no pattern's.

A picture of a single line leaves most pixels as black as they were. Combs leave none without first orders,
but their pictures at the first setting say how much light these are.
"""

from __future__ import annotations

from collections import deque
from statistics import median

import numpy as np

from dsl_core.capture.proof.prediction import Expected, Lit, Places
from dsl_core.capture.proof.raster import Counts, Floats
from dsl_core.model.plan import Shot
from dsl_core.solve.normal import STD_OF_MEDIAN_SIZE

#: A step from what was usual, DN, and in deviations of that: what the first setting is off by is scaled up.
LEAST_DN, SIGMAS = 40.0, 8.0
#: Pictures needed before one can be unlike them, and how many are remembered.
FEWEST, REMEMBERED = 3, 9
#: Pixels that no line lights of a picture that says something.
FEWEST_UNLIT = 100


class CommonLight:
    """Remembers what pictures of lines had in all pixels beyond their prediction, by setting."""

    def __init__(self) -> None:
        """Start without any picture."""
        self._known: dict[int, deque[float]] = {}

    def copy(self) -> CommonLight:
        """What is remembered now."""
        twin = CommonLight()
        twin._known = {setting: known.copy() for setting, known in self._known.items()}
        return twin

    def step(self, shot: Shot, more_dn: float) -> float:
        """What a picture has more than those before it, DN; 0 if that is usual, which is remembered."""
        known = self._known.setdefault(shot.setting, deque(maxlen=REMEMBERED))
        if len(known) >= FEWEST:
            usual = median(known)
            spread = STD_OF_MEDIAN_SIZE * median(abs(each - usual) for each in known)
            if abs(more_dn - usual) > max(LEAST_DN, SIGMAS * spread):
                return more_dn - usual
        known.append(more_dn)
        return 0.0


def common_light(seen: Counts, wanted: Expected, lit: Lit, profile: Floats, full_dn: float) -> float | None:
    """What all pixels that no line lights have more than expected, DN: the median; None where few tell.

    ``profile`` is the `line_profile` of the pattern.
    """
    unlit = lit.index[Places.of(lit, profile).unlit]
    unlit = unlit[(seen[unlit] < full_dn) & (wanted.counts[unlit] < full_dn)]
    if unlit.size < FEWEST_UNLIT:
        return None
    # Those of the first setting are scaled counts, a few values only: differences are not.
    return float(np.median(seen[unlit] - wanted.counts[unlit]))
