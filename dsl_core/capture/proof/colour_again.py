"""Whether white, captured again, has the colour of the beginning: lamps and displays change it unseen.

One that fades or brightens is corrected for by one number for all colours; a change of colour is not, and
makes every reflectance off where one colour has lost light and another has not.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsl_core.capture.proof.noise import Noise
from dsl_core.capture.proof.raster import Counts
from dsl_core.capture.proof.white_again import repeats
from dsl_core.model.conditions import COLOUR_NAMES
from dsl_core.model.plan import CapturePlan, Shot

#: How far the light of a colour may be from that of green, as a share, and in deviations.
LEAST, SIGMAS = 0.015, 6.0
#: Light of a colour says something where it is so many deviations bright: nearly all of white may saturate.
BRIGHT_SIGMAS = 24.0


@dataclass(frozen=True)
class ColourAgain:
    """Light of white, captured again as ``shot``, over that of the first: ``ratios`` of red, green and blue.

    A colour of which nothing is known is NaN; ``apart`` is the largest step from green, as a share.
    """

    shot: Shot
    ratios: tuple[float, float, float]
    apart: float

    @property
    def sentence(self) -> str:
        """What is wrong, and what to do."""
        known = [(n, r) for n, r in zip(COLOUR_NAMES, self.ratios, strict=True) if np.isfinite(r)]
        each = ", ".join(f"{ratio:.2f} times in {name}" for name, ratio in known)
        return (
            f"White, captured again as frame {self.shot.number}, has another colour than at the beginning:"
            f" its light is {each}. Frames before may be off by as much. Switch night mode, colour"
            " temperature and automatic white balance of computer, projector and camera off, let the"
            " projector warm up for longer, and scan again."
        )


def colour_again(
    plan: CapturePlan, kept: Mapping[int, Counts], noise: Noise, channels: NDArray[np.int8]
) -> ColourAgain | None:
    """The white, of all that were captured again, whose colour differs most; None if none does.

    ``kept`` are the rasters of shots, by index; ``channels`` the colour of each of their pixels: 0 red, 1
    green, 2 blue.
    """
    found = (_compared(shot, before, now, noise, channels) for shot, before, now in repeats(plan, kept))
    differ = (one for one in found if one is not None)
    return max(differ, key=lambda one: one.apart, default=None)


def _compared(
    shot: Shot,
    before: tuple[Counts, Counts],
    now: tuple[Counts, Counts],
    noise: Noise,
    channels: NDArray[np.int8],
) -> ColourAgain | None:
    """What two whites, each with its black, differ by in each colour."""
    full = noise.sensor.full_scale_dn
    sound = (before[0] < full) & (now[0] < full)
    ratios, stds = np.full(3, np.nan), np.full(3, np.nan)
    for colour in range(3):
        of = sound & (channels == colour)
        first, second = (
            float(pair[0][of].sum(dtype=np.float64)) - float(pair[1][of].sum(dtype=np.float64))
            for pair in (before, now)
        )
        variance = sum(float(noise.variance(each)[of].sum(dtype=np.float64)) for each in (*before, *now))
        if first > BRIGHT_SIGMAS * np.sqrt(variance):
            ratios[colour], stds[colour] = second / first, np.sqrt(variance) / first
    if not np.isfinite(ratios[1]):
        return None
    apart = np.abs(ratios / ratios[1] - 1)
    told = apart > np.maximum(LEAST, SIGMAS * np.hypot(stds, stds[1]))
    if not told.any():
        return None
    red, green, blue = (float(each) for each in ratios)
    return ColourAgain(shot, (red, green, blue), float(apart[told].max()))
