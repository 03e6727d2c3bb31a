"""Lateral colour: lenses that magnify red and blue differently, about their optical centres."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.geometry import Lens
from dsl_core.simulation.foreign.variants import Foreign

#: Distance of red and blue at the side of the picture, half its width from the middle, in its own pixels.
APART_PX = 0.5
#: What red and blue are to the projector, nm: middles of its LEDs; green lies about half way.
RED_NM, BLUE_NM = 630.0, 455.0


def camera_of_colour(lens: Lens, channel: int, foreign: Foreign) -> Lens:
    """The lens as one colour of the mosaic (0 red, 1 green, 2 blue) sees through it."""
    if not foreign.has("lateral-colour"):
        return lens
    more = (0.5, 0.0, -0.5)[channel] * APART_PX / (lens.width_px / 2)
    return lens.model_copy(update={"fx_px": lens.fx_px * (1 + more), "fy_px": lens.fy_px * (1 + more)})


def projector_magnification(
    lens: Lens, wavelengths_nm: NDArray[np.float64], foreign: Foreign
) -> NDArray[np.float64]:
    """Magnification of light of each wavelength, relative to that half way from blue to red."""
    if not foreign.has("lateral-colour"):
        return np.ones_like(wavelengths_nm)
    place = (wavelengths_nm - 0.5 * (RED_NM + BLUE_NM)) / (RED_NM - BLUE_NM)
    return np.asarray(1 + place * APART_PX / (lens.width_px / 2))
