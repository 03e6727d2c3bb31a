"""Whether the code had the colours that white has: a pattern and its inverse together are white in each.

Where a camera balances its colours, or a display turns warmer, while the code is captured, white and all
lines are of one colour, and nothing after it contradicts that; the pairs before do.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsl_core.capture.proof.code.code_pairs import Pair
from dsl_core.capture.proof.colour_again import BRIGHT_SIGMAS, LEAST, SIGMAS
from dsl_core.capture.proof.noise import Noise
from dsl_core.capture.proof.raster import Counts
from dsl_core.model.conditions import COLOUR_NAMES

#: So many pairs have to have another colour than white: one alone is a wrong picture.
FEWEST_PAIRS = 2
#: What black may have changed by unseen, DN.
UNSEEN_DN = 0.5


@dataclass(frozen=True)
class CodeColours:
    """Light of so many ``pairs`` over that of white: ``ratios`` of red, green and blue; NaN if untold."""

    pairs: int
    ratios: tuple[float, float, float]

    @property
    def sentence(self) -> str:
        """What is wrong, and what to do."""
        known = [(n, r) for n, r in zip(COLOUR_NAMES, self.ratios, strict=True) if np.isfinite(r)]
        each = ", ".join(f"{ratio:.2f} times in {name}" for name, ratio in known)
        return (
            f"{self.pairs} pairs of the code have another colour than white, which each of them adds up to:"
            f" their light is {each}. Colours changed before white was captured, and no picture tells which"
            " are as calibrated: reflectances may be off by as much. Switch automatic white balance of the"
            " camera and night mode of projector and computer off, let the projector warm up, and scan again."
        )


def code_colours(
    pairs: Mapping[int, Pair], ends: tuple[Counts, Counts], noise: Noise, channels: NDArray[np.int8]
) -> CodeColours | None:
    """What ``pairs``, by their number, differ by from the ``ends``, white and black; None if nothing.

    ``channels`` is the colour of each pixel: 0 red, 1 green, 2 blue.
    """
    full = noise.sensor.full_scale_dn
    light = ends[0].astype(np.float32) - ends[1]
    variance = noise.variance(ends[0]) + noise.variance(ends[1])
    found = []
    for pair in pairs.values():
        sound = np.maximum.reduce([*pair, *ends]) < full
        ratios, stds = np.full(3, np.nan), np.full(3, np.nan)
        total = pair[0].astype(np.float32) + pair[1] - 2 * ends[1].astype(np.float32)
        for colour in range(3):
            of = sound & (channels == colour)
            white = float(light[of].sum(dtype=np.float64))
            noise_dn = 2 * float(np.sqrt(variance[of].sum(dtype=np.float64)))
            if white > BRIGHT_SIGMAS * noise_dn:
                ratios[colour] = float(total[of].sum(dtype=np.float64)) / white
                stds[colour] = (noise_dn + 2 * UNSEEN_DN * int(of.sum())) / white
        apart = np.abs(ratios / ratios[1] - 1)
        # Values that are not proportional to the light make edges of stripes brighter in every colour.
        least = max(LEAST, abs(ratios[1] - 1)) + stds + stds[1]
        if (apart > np.maximum(least, SIGMAS * np.hypot(stds, stds[1]))).any():
            found.append(ratios)
    if len(found) < FEWEST_PAIRS:
        return None
    red, green, blue = (float(each) for each in np.median(found, axis=0))
    return CodeColours(len(found), (red, green, blue))
