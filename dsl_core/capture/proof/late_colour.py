"""Whether one colour of a picture shows the pattern before, though the others show their own.

A colour of the projector may come late by itself, and so may packets of a camera that sends colours one after
the other. Most of its light may be in first orders, where columns of the projector are not known.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dsl_core.capture.proof.contest import Contest
from dsl_core.capture.proof.noise import Noise
from dsl_core.capture.proof.prediction import Expected, contest_of_pixels
from dsl_core.capture.proof.raster import Counts
from dsl_core.model.conditions import COLOUR_NAMES

#: A colour of the pattern before has so many votes whose mean is below this. It cannot be -1: pixels see a
#: quarter of another LED's light, which is in its place. One that has lost half of its light has 0.
FEWEST_VOTES, MOST_MEAN = 12, -0.25


def is_of_another(contest: Contest) -> bool:
    """Whether one colour of a picture seems to be of another pattern."""
    return contest.count >= FEWEST_VOTES and contest.mean < MOST_MEAN


def late_colour(
    seen: Counts, wanted: Counts, before: Counts, black: Counts, channels: NDArray[np.int8], noise: Noise
) -> str:
    """The colour of ``seen`` that is that of the picture ``before``; empty if none is.

    ``wanted`` is another picture of the same pattern. All are rasters, ``channels`` the colours of their
    pixels: 0 red, 1 green, 2 blue.
    """
    for colour, name in enumerate(COLOUR_NAMES):
        own = np.flatnonzero(channels == colour)
        if not own.size:  # a monochrome camera
            continue
        one, two = (
            Expected(each[own].astype(np.float32), noise.variance(each)[own]) for each in (wanted, before)
        )
        dark = black[own].astype(np.float32)
        found = contest_of_pixels(seen[own], noise.variance(seen)[own], one, two, dark, None)
        if is_of_another(found):
            return name
    return ""
