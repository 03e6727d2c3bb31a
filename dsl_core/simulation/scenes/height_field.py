"""Surfaces given as depth over x and y, met by marching along the ray."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsl_core.simulation.scenes.surfaces import Paint

Floats = NDArray[np.float64]
#: Depth z in mm over x and y in mm, all of shape (n,).
Height = Callable[[Floats, Floats], Floats]

#: Rays stop this far in front of the surface (along z), mm.
_TOLERANCE_MM = 1e-4
_DIFFERENCE_MM = 1e-3
_MAX_STEPS = 4000


@dataclass(frozen=True)
class HeightField:
    """The surface ``z = height(x, y)``, nearest at ``low_mm``, nowhere steeper than ``steepest`` (mm/mm)."""

    height: Height
    low_mm: float
    steepest: float
    painter: Paint

    def intersect(self, origin: Floats, directions: Floats) -> Floats:
        """See `Surface`.

        Sphere tracing (J. C. Hart, The Visual Computer 12, 1996): the gap along z divided by the fastest
        rate at which a ray can close it is a step that never passes the surface.
        """
        rate = directions[2] + self.steepest * np.hypot(directions[0], directions[1])
        t = np.maximum((self.low_mm - origin[2]) / directions[2], 0.0)
        active = np.arange(t.size)
        for _ in range(_MAX_STEPS):
            x, y, z = origin[:, None] + t[active] * directions[:, active]
            gap = self.height(x, y) - z
            open_rays = gap > _TOLERANCE_MM
            active = active[open_rays]
            if active.size == 0:
                break
            t[active] += gap[open_rays] / rate[active]
        return np.where(t > 0, t, np.inf)

    def normals(self, points: Floats) -> Floats:
        """See `Surface`: from central differences of the height, ``(dz/dx, dz/dy, -1)`` made unit."""
        x, y = points[:2]
        h = _DIFFERENCE_MM
        slope_x = (self.height(x + h, y) - self.height(x - h, y)) / (2 * h)
        slope_y = (self.height(x, y + h) - self.height(x, y - h)) / (2 * h)
        normals = np.stack([slope_x, slope_y, -np.ones_like(x)])
        return np.asarray(normals / np.linalg.norm(normals, axis=0))

    def paint(self, points: Floats) -> NDArray[np.int32]:
        """See `Surface`."""
        return self.painter(points[0], points[1])


def height_field(height: Height, half_size_mm: tuple[float, float], painter: Paint) -> HeightField:
    """A height field whose range and steepest slope are taken from a 1 mm raster of its middle part.

    Outside ``half_size_mm`` the height must be flatter and deeper than inside. A tenth is added to the slope
    and a millimetre to the range for what lies between the samples.
    """
    x, y = np.meshgrid(*[np.arange(-half, half + 0.5) for half in half_size_mm])
    z = height(x.ravel(), y.ravel()).reshape(x.shape)
    slopes = np.hypot(*np.gradient(z))
    return HeightField(height, float(z.min()) - 1.0, 1.1 * float(slopes.max()) + 0.05, painter)
