"""Whether white follows its drive level as the calibration says: what projector and computer do to levels.

A scan at one level cannot tell: all its pictures are brighter or darker alike, as another scene's would be.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from dsl_core.capture.proof.noise import Noise
from dsl_core.capture.proof.raster import Counts
from dsl_core.model.conditions import COLOUR_NAMES
from dsl_core.model.plan import Shot
from dsl_core.model.rig import ProjectorResponse

#: The other level, as a share of that of the plan, and how far its light may be from the calibration's: a
#: gamma that is .08 off, more than any self-test leaves, makes as much.
HALF, ALLOWED = 0.5, 0.06
#: Light of white at that level, DN on average, below which nothing is said.
LEAST_DN = 20.0


def at_half_level(white: Shot) -> Shot:
    """White at the level that a shot of white is compared with."""
    return replace(white, level=HALF * white.level)


def doubt_of_levels(
    bright: Counts, black: Counts, dim: Counts, level: float, response: ProjectorResponse,
    channels: NDArray[np.int8], noise: Noise,
) -> str:  # fmt: skip
    """What white contradicts of its calibration, as a sentence; empty if nothing.

    ``bright`` and ``dim`` are rasters of white at a drive level and at half of it, ``black`` one of black,
    all with one exposure, and ``channels`` the colours of their pixels.
    """
    sound = bright < noise.sensor.full_scale_dn
    wanted = _light(response, HALF * level) / _light(response, level)
    found: dict[str, float] = {}
    for colour in np.unique(channels):
        own = sound & (channels == colour)
        more, less = (each[own].astype(np.float64) - black[own] for each in (bright, dim))
        if not own.any() or max(less.mean(), wanted * more.mean()) < LEAST_DN or more.sum() <= 0:
            continue
        found[COLOUR_NAMES[colour]] = float(less.sum() / more.sum()) / wanted
    if max((abs(share - 1) for share in found.values()), default=0.0) < ALLOWED:
        return ""
    has_colours = np.unique(channels).size > 1
    shares = ", ".join(f"{share:.2f}{f' in {name}' if has_colours else ''}" for name, share in found.items())
    return (
        "At half the drive level, white has another share of its light than the calibration says:"
        f" {shares} times that. Something changes levels on their way: a picture mode of the projector"
        " (vivid, gamma, contrast), limited levels (16-235), colour management of the computer; or values"
        " of the camera are not proportional to the light. Set both as for the self-test, or repeat it."
    )


def _light(response: ProjectorResponse, level: float) -> float:
    """Light above black at a drive level, of full light."""
    return float(response.radiance(level)) - response.black_fraction
