"""Whether pictures of lines have the noise that a camera's pictures have, one after the other.

Every exposure has noise of its own, so that dark pixels change from line to line. A camera that means its
pictures over time, or smooths them, changes less; faint first orders then lag behind, or are smeared, while
everything bright looks right.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from dsl_core.capture.proof.noise import Noise
from dsl_core.capture.proof.raster import Counts
from dsl_core.model.plan import Shot

#: Deviation over the one stated below which lines are calm: no sensor has less, and light that wanders from
#: line to line gives them more. Clean scans of all scenes have 1.16 and more.
CALM = 0.75
#: Share of the pixels that count, those that change least, and what they have of the mean size of all noise.
MOST, MOST_SIZE = 0.9, 0.657
#: Pairs of lines needed to say anything.
FEWEST = 8


@dataclass(frozen=True)
class CalmLines:
    """Deviation of what dark pixels change by from line to line over what the calibration states."""

    times: float

    @property
    def sentence(self) -> str:
        """What is wrong, and what to do."""
        return (
            f"From one line to the next, dark pixels change by {self.times:.2f} times the noise of the"
            " calibration, and bright light has all of it: the camera smooths dark pixels, or means them with"
            " those of the pictures before (noise reduction). First orders are faint, and lag behind or are"
            " smeared; reflectances are off by far more than they state. Switch noise reduction off, store"
            " raw values, and scan again."
        )


def calm_lines(lines: Sequence[Shot], kept: Mapping[int, Counts], noise: Noise) -> CalmLines | None:
    """How calm ``lines`` of one setting are, from the raster of each shot; None if they have their noise.

    None as well with few lines. Ask only of a camera whose bright pictures have the noise that is stated.
    """
    stated = Noise(noise.stated)
    found = [
        _deviation(np.subtract(kept[b.index], kept[a.index], dtype=np.float32) / _sigma(kept, a, b, stated))
        for a, b in pairwise(lines)
        if a.index in kept and b.index in kept
    ]
    if len(found) < FEWEST:
        return None
    times = float(np.median(found))
    return CalmLines(times) if times < CALM else None


def _sigma(kept: Mapping[int, Counts], one: Shot, other: Shot, noise: Noise) -> NDArray[np.float32]:
    return np.asarray(np.sqrt(noise.variance(kept[one.index]) + noise.variance(kept[other.index])))


def _deviation(apart: NDArray[np.floating]) -> float:
    """Deviation of most values, as that of normal ones of which the largest are left out."""
    size = np.sort(np.abs(apart), axis=None)
    return float(size[: int(MOST * size.size)].mean()) / MOST_SIZE
