"""Where in its spot a pixel's light comes from: two answers, for a soft spot and for an even one.

A lens out of focus makes the spot soft. Its light then comes from as many times its variance away as the
logarithm of the picture changes per pixel. A sharp lens leaves the area of the pixel, evenly: an edge goes
through a pixel or it does not, and where it does, how much of the pixel is on its bright side is what the
light says between that of the neighbours on both sides.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Map = NDArray[np.float64]

#: Slope of a ramp from seven neighbours, of one colour each, in a mosaic: those of the own colour give the
#: level, those of the other how it bends between them.
MOSAIC_SLOPE = np.array([0.125, -0.25, -0.375, 0.0, 0.375, 0.25, -0.125])
PLAIN_SLOPE = np.array([-0.5, 0.0, 0.5])
#: Light below so many of its deviations counts as that.
DARK_SIGMAS = 2.0
#: Variance of a square pixel along its sides, px^2.
EVEN_PX2 = 1 / 12


def light_slopes(amplitude: NDArray[np.floating], std: NDArray[np.floating], plain: bool = False) -> Map:
    """Gradient of the logarithm of the light (rows, columns), across and down, (2, rows, columns), 1/px.

    ``std`` is the deviation of the light. Each pixel has one colour of a mosaic, unless it is ``plain``.
    """
    from scipy.ndimage import correlate1d

    log = np.log(_lit(amplitude, std))
    weights = PLAIN_SLOPE if plain else MOSAIC_SLOPE
    return np.stack([correlate1d(log, weights, axis, mode="mirror") for axis in (1, 0)])


def even_pulls(amplitude: NDArray[np.floating], std: NDArray[np.floating], plain: bool = False) -> Map:
    """How far from its middle the light of an even pixel comes over its variance, (2, rows, columns), 1/px.

    With arguments as for `light_slopes`. Of an edge between the levels of both neighbours of its colour, a
    pixel that sees a share ``b`` of the bright side sees its light ``(1 - b) / 2`` away, and that of the
    other side ``b / 2`` the other way. Where light is not between both, no edge is seen.
    """
    light, apart = _lit(amplitude, std), 1 if plain else 2
    padded = np.pad(light, apart, mode="edge")
    inner = slice(apart, -apart)
    found = []
    for first, last in (
        (padded[inner, : -2 * apart], padded[inner, 2 * apart :]),
        (padded[: -2 * apart, inner], padded[2 * apart :, inner]),
    ):
        between = (light - first) * (last - light)
        away = np.divide(between, 2 * light * (last - first), where=between > 0, out=np.zeros_like(light))
        found.append(away / EVEN_PX2)
    return np.stack(found)


def _lit(amplitude: NDArray[np.floating], std: NDArray[np.floating]) -> Map:
    """Light that is no darker than its deviation says; NaN where it is not known."""
    known = np.isfinite(amplitude)
    floor = DARK_SIGMAS * np.where(np.isfinite(std), std, 0.0)
    least = np.maximum(floor, 1e-6 * np.max(amplitude, initial=0.0, where=known) + 1e-30)
    return np.where(known, np.maximum(amplitude, least), np.nan).astype(np.float64)
