"""What white, taken before a scan, contradicts of the calibration."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from dsl_core.capture.exposure import ShotTaker
from dsl_core.capture.proof.lasting.levels import at_half_level, doubt_of_levels
from dsl_core.capture.proof.lasting.missing_light import missing_light
from dsl_core.capture.proof.lasting.written_row import written_row
from dsl_core.capture.proof.noise import Noise
from dsl_core.capture.proof.raster import Raster
from dsl_core.model.plan import Shot
from dsl_core.model.rig import Rig


def doubts_of_white(taker: ShotTaker, white: Shot, seen: NDArray[np.uint16], rig: Rig) -> str:
    """What white contradicts of its calibration, in sentences; empty if nothing.

    ``seen`` is its raw mosaic (rows, columns). Takes black, and white at another level, with the same
    exposure. Raises `DeviceError` when a picture cannot be taken, `Cancelled`.
    """
    raster = Raster((seen.shape[1], seen.shape[0]))
    noise, channels = Noise.of(rig.sensor, rig.sensor.bit_depth), raster.channels(rig.sensor.bayer)
    shots = replace(white, role="black"), at_half_level(white)
    black, dim = (raster.take(taker.take(each).pixels) for each in shots)
    written = written_row(black, noise, raster)
    if written is not None:
        return written.sentence
    bright = raster.take(seen)
    noise.find_end(bright, channels)
    return missing_light(bright, black, rig, channels, noise, raster) or doubt_of_levels(
        bright, black, dim, white.level, rig.projector_response, channels, noise
    )
