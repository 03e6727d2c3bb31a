"""How a bandpass filter before the camera passes shorter wavelengths the more askew light goes through it.

The centre of an interference filter is at ``centre * sqrt(1 - (sin(angle) / index)^2)``, the angle being that
to the filter's normal and ``index`` the effective one of its layers, 1.5 to 2.2 (Macleod, Thin-Film Optical
Filters). With the direction (x, y, z) of a pixel and a filter tilted by small angles, the relative shift is a
constant, which nobody can tell from the film's line density, and ``-c (x^2 + y^2) / 2 + a x + b y`` with
``c = 1 / index^2``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.rig import Rig
from dsl_core.optics.pinhole import pixel_rays

Floats = NDArray[np.float64]

#: Deviations before anything is seen, of c, a and b: any index, or no such filter; tilts of some degrees.
PRIOR_STD = np.array([0.3, 0.03, 0.03])
#: The shift is that of filters only where c is so many deviations above nothing.
SIGNIFICANT = 5.0


@dataclass(frozen=True)
class FilterAngle:
    """``c``, ``a`` and ``b`` of the relative shift, and their deviations."""

    values: tuple[float, float, float] = (0.0, 0.0, 0.0)
    std: tuple[float, float, float] = (0.0, 0.0, 0.0)

    @property
    def is_significant(self) -> bool:
        """Whether the light seen is shifted as by filters, beyond doubt."""
        return self.values[0] > SIGNIFICANT * self.std[0]

    @property
    def index(self) -> tuple[float, float] | None:
        """Effective index with its deviation; None where no shift is seen."""
        if not self.is_significant:
            return None
        value = self.values[0] ** -0.5
        return value, 0.5 * value**3 * self.std[0]


#: Filters that shift nothing.
NO_SHIFT = FilterAngle()


def shift_terms(rig: Rig, pixels: NDArray[np.int64]) -> Floats:
    """What ``c``, ``a`` and ``b`` do to the relative wavelength at flat pixel indices (n,), shape (n, 3)."""
    rays = pixel_rays(rig.camera).reshape(3, -1)[:, pixels]
    x, y, _ = rays / np.linalg.norm(rays, axis=0)
    return np.stack([-0.5 * (x**2 + y**2), x, y], 1)
