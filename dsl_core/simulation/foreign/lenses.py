"""Lateral colour: lenses that magnify red and blue differently, about their optical centres."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.geometry import Lens
from dsl_core.simulation.foreign.variants import Foreign

#: Distance of red and blue at the side of the picture, as a share of half its width: half a pixel of the
#: published camera (890 px wide) and projector (640 px), whatever the picture's size.
CAMERA_APART, PROJECTOR_APART = 0.5 / 445, 0.5 / 320
#: What red and blue are to the projector, nm: middles of its LEDs.
RED_NM, BLUE_NM = 630.0, 455.0


def camera_of_colour(lens: Lens, channel: int, foreign: Foreign) -> Lens:
    """The lens as one colour of the mosaic (0 red, 1 green, 2 blue) sees through it."""
    if not foreign.has("lateral-colour"):
        return lens
    ratio = 1 + (0.5, 0.0, -0.5)[channel] * CAMERA_APART
    return lens.model_copy(update={"fx_px": lens.fx_px * ratio, "fy_px": lens.fy_px * ratio})


def projector_magnification(wavelengths_nm: NDArray[np.float64], foreign: Foreign) -> NDArray[np.float64]:
    """Magnification of light of each wavelength, relative to that half way from blue to red."""
    if not foreign.has("lateral-colour"):
        return np.ones_like(wavelengths_nm)
    place = (wavelengths_nm - 0.5 * (RED_NM + BLUE_NM)) / (RED_NM - BLUE_NM)
    return np.asarray(1 + place * PROJECTOR_APART)
