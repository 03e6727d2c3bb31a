"""How much light of the projector a point receives, and planes in front of a camera."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.rig import Rig
from dsl_core.optics.pinhole import pixel_rays

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Plane:
    """The points x with ``inverse . x = 1``, camera coordinates; ``inverse`` has shape (3,), 1/mm.

    The inverse depth along a ray (x, y, 1) is then simply ``inverse . ray``.
    """

    inverse: Floats

    @property
    def normal(self) -> Floats:
        """Unit normal towards the camera, shape (3,)."""
        return np.asarray(-self.inverse / np.linalg.norm(self.inverse))

    @property
    def distance_mm(self) -> float:
        """Where the camera's axis meets the plane, mm."""
        return float(1 / self.inverse[2])

    @property
    def tilt_deg(self) -> float:
        """Angle between the plane's normal and the camera's axis, degrees."""
        return float(np.rad2deg(np.arccos(np.clip(-self.normal[2], -1, 1))))

    def depth_mm(self, rig: Rig) -> Floats:
        """Depth at every pixel, shape (rows, columns); NaN where the plane is behind the camera."""
        inverse = np.tensordot(self.inverse, pixel_rays(rig.camera), 1)
        return np.asarray(1 / np.where(inverse > 0, inverse, np.nan))


def shading(rig: Rig, points_mm: Floats, normals: Floats) -> Floats:
    """``cos(incidence) (reference distance / distance)^2`` of points and unit normals, each (3, ...)."""
    shape = (3,) + (1,) * (points_mm.ndim - 1)
    to_light = rig.pose.projector_centre_mm.reshape(shape) - points_mm
    distance = np.linalg.norm(to_light, axis=0)
    cosine = (normals * to_light).sum(0) / distance
    return np.asarray(np.maximum(cosine, 0) * (rig.reference_distance_mm / distance) ** 2)


def plane_shading(rig: Rig, plane: Plane) -> Floats:
    """Shading of a plane at every pixel of the camera, shape (rows, columns), NaN where it has none."""
    points = pixel_rays(rig.camera) * plane.depth_mm(rig)
    return shading(rig, points, plane.normal[:, None, None])
