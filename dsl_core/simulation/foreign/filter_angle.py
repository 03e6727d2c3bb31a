"""A bandpass filter in front of the camera: tilted, and seen at another angle by every pixel."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.geometry import Lens
from dsl_core.optics.pinhole import pixel_rays
from dsl_core.simulation.foreign.variants import Foreign

#: Effective refractive index of the layers, and tilt of the filter about a vertical axis, degrees.
INDEX, TILT_DEG = 1.9, 3.0


def centre_ratio(lens: Lens, foreign: Foreign) -> NDArray[np.float64]:
    """Centre of the band at every pixel relative to that of light straight through, (rows * columns,).

    ``sqrt(1 - (sin angle / index)^2)`` (Macleod, Thin-Film Optical Filters).
    """
    rays = pixel_rays(lens).reshape(3, -1)
    if not foreign.has("filter-angle"):
        return np.ones(rays.shape[1])
    tilt = np.radians(TILT_DEG)
    normal = np.array([np.sin(tilt), 0.0, np.cos(tilt)])
    cosine = normal @ rays / np.linalg.norm(rays, axis=0)
    return np.asarray(np.sqrt(1 - (1 - cosine**2) / INDEX**2))
