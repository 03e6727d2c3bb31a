"""Whether a sensor is read out in parts that differ: black then has a step, in every row at the same column.

What is left of black once its share of white is taken off is level, but for light of the room, whose edges
are neither sharp nor vertical all over the picture.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsl_core.capture.proof.noise import Noise
from dsl_core.capture.proof.raster import Counts, Raster

#: A step is at least so high, DN, and so many times as high as any other; columns that are compared.
LEAST_DN, TIMES, NEAR = 3.0, 3.0, 4
#: Of all rows, this share has to have at least so much of it.
MOST, SHARE = 0.9, 0.3


@dataclass(frozen=True)
class SensorParts:
    """A step of black by ``step_dn`` at a ``column`` of the camera."""

    column: int
    step_dn: float

    @property
    def sentence(self) -> str:
        """What is wrong, and what to do."""
        return (
            f"From column {self.column} of the picture on, black is {abs(self.step_dn):.0f} DN"
            f" {'higher' if self.step_dn > 0 else 'lower'}, in all rows: the camera reads its sensor out in"
            " parts whose black level, and perhaps gain, differ. Switch to a mode with one tap, or have the"
            " camera balance them, and repeat self-test and scan."
        )


def sensor_parts(
    white: Counts, black: Counts, channels: NDArray[np.int8], noise: Noise, raster: Raster, width_px: int
) -> SensorParts | None:
    """Where black, raster of a setting as ``white`` is, has a step; None where it has none.

    ``channels`` are the colours of their pixels, ``width_px`` the columns of the camera.
    """
    light = (white.astype(np.float32) - black).reshape(raster.shape)
    rest = (black.astype(np.float32) - np.float32(noise.sensor.black_level_dn)).reshape(raster.shape)
    sound = (white < noise.sensor.full_scale_dn).reshape(raster.shape)
    grid = np.full(raster.shape, np.nan, np.float32)
    for colour in np.unique(channels):
        own = (channels == colour).reshape(raster.shape) & sound
        # From pixel to pixel, as a step would make black seem to hold more of white.
        both = own[:, 2:] & own[:, :-2]
        more, glow = ((each[:, 2:] - each[:, :-2])[both] for each in (light, rest))
        total = float(more @ more)
        grid[own] = (rest - light * (float(more @ glow) / total if total > 0 else 0.0))[own]
    if grid.shape[1] < 8 * NEAR:
        return None
    edges = np.arange(NEAR, grid.shape[1] - NEAR + 1, 2)
    is_known = np.isfinite(grid)
    known = np.where(is_known, grid, np.float32(0))
    left, right = (
        [
            np.sum([values[:, edges + at] for at in places], axis=0)
            for values in (known, is_known.astype(np.float32))
        ]
        for places in (range(-NEAR, 0), range(NEAR))
    )
    both = (left[1] > 0) & (right[1] > 0)
    apart = right[0] / np.maximum(right[1], 1) - left[0] / np.maximum(left[1], 1)
    apart[~both] = np.nan
    # Where much of a column saturates in white, nothing is said of it.
    told = both.mean(axis=0) >= MOST
    edges, apart = edges[told], apart[:, told]
    if edges.size < 2 * NEAR:
        return None
    steps = np.nanmedian(apart, axis=0)
    found = int(np.abs(steps).argmax())
    step = float(steps[found])
    others = np.abs(np.delete(steps, np.s_[max(found - NEAR, 0) : found + NEAR + 1]))
    if abs(step) < max(LEAST_DN, TIMES * float(others.max(initial=0.0))):
        return None
    if float((apart[:, found] / step > SHARE).mean()) < MOST:
        return None
    return SensorParts(int(edges[found] * width_px / grid.shape[1]), step)
