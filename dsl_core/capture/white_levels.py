"""Whether white follows its drive level as the calibration says: what projector and computer do to levels.

A scan at one level cannot tell: all its pictures are brighter or darker alike, as another scene's would be.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from dsl_core.capture.exposure import ShotTaker
from dsl_core.capture.proof.lasting.missing_light import missing_light
from dsl_core.capture.proof.lasting.written_row import written_row
from dsl_core.capture.proof.noise import Noise
from dsl_core.capture.proof.raster import Raster
from dsl_core.model.conditions import COLOUR_NAMES
from dsl_core.model.plan import Shot
from dsl_core.model.rig import ProjectorResponse, Rig

#: The other level, as a share of that of the plan, and how far its light may be from the calibration's: a
#: gamma that is .08 off, more than any self-test leaves, makes as much.
HALF, ALLOWED = 0.5, 0.06
#: Light of white at that level, DN on average, below which nothing is said.
LEAST_DN = 20.0


def doubts_of_white(taker: ShotTaker, white: Shot, seen: NDArray[np.uint16], rig: Rig) -> str:
    """What white contradicts of its calibration, in sentences; empty if nothing.

    ``seen`` is its raw mosaic (rows, columns). Takes black, and white at another level, with the same
    exposure. Raises `DeviceError` when a picture cannot be taken, `Cancelled`.
    """
    raster = Raster((seen.shape[1], seen.shape[0]))
    noise, channels = Noise.of(rig.sensor, rig.sensor.bit_depth), raster.channels(rig.sensor.bayer)
    half = replace(white, level=HALF * white.level)
    black, dim = (raster.take(taker.take(each).pixels) for each in (replace(white, role="black"), half))
    written = written_row(black, noise, raster, seen.shape[1])
    if written is not None:
        return written.sentence
    bright = raster.take(seen)
    missing = missing_light(bright, black, rig, channels, noise, raster)
    if missing:
        return missing
    sound = bright < noise.sensor.full_scale_dn
    wanted = _light(rig.projector_response, half.level) / _light(rig.projector_response, white.level)
    found: dict[str, float] = {}
    for colour in np.unique(channels):
        own = sound & (channels == colour)
        more, less = (each[own].astype(np.float64) - black[own] for each in (bright, dim))
        if not own.any() or less.mean() < LEAST_DN:
            continue
        found[COLOUR_NAMES[colour]] = float(less.sum() / more.sum()) / wanted
    if max((abs(share - 1) for share in found.values()), default=0.0) < ALLOWED:
        return ""
    shares = ", ".join(f"{share:.2f} in {name}" for name, share in found.items())
    return (
        "At half the drive level, white has another share of its light than the calibration says:"
        f" {shares} times that. Something changes levels on their way: a picture mode of the projector"
        " (vivid, gamma, contrast), limited levels (16-235), colour management of the computer; or values"
        " of the camera are not proportional to the light. Set both as for the self-test, or repeat it."
    )


def _light(response: ProjectorResponse, level: float) -> float:
    """Light above black at a drive level, of full light."""
    return float(response.radiance(level)) - response.black_fraction
