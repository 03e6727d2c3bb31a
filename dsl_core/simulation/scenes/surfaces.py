"""Where rays meet surfaces, and what is in shadow.

Planes, spheres and boxes have a closed form; surfaces given as depth over x and y are met by marching along
the ray.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
#: Material index of points given by two surface coordinates in mm.
Paint = Callable[[Floats, Floats], NDArray[np.int32]]

#: Half sizes of a surface without end.
ENDLESS = (math.inf, math.inf)
#: A point is in shadow when the projector's ray is stopped this much before it, as a share of the ray.
_SHADOW_MARGIN = 1e-5


#: Depth z in mm over x and y in mm, all of shape (n,).
Height = Callable[[Floats, Floats], Floats]

#: Rays stop this far in front of the surface (along z), mm.
_TOLERANCE_MM = 1e-4
_DIFFERENCE_MM = 1e-3
_MAX_STEPS = 4000


class Shape(Protocol):
    """Something a ray can hit."""

    def intersect(self, origin: Floats, directions: Floats) -> Floats:
        """Smallest ``t > 0`` with ``origin + t * directions`` on it, inf if none; directions (3, n)."""

    def normals(self, points: Floats) -> Floats:
        """Unit normals at points on the surface (3, n), either side."""

    def paint(self, points: Floats) -> NDArray[np.int32]:
        """Material index at points on the surface, shape (n,)."""


def uniform(material: int) -> Paint:
    """The same material everywhere."""
    return lambda u, v: np.full(u.shape, material, np.int32)


@dataclass(frozen=True)
class Rectangle:
    """A flat patch spanned by two orthonormal axes around a centre, with half sizes in mm (inf: a plane)."""

    centre_mm: Floats
    axis_u: Floats
    axis_v: Floats
    half_size_mm: tuple[float, float]
    painter: Paint

    @property
    def normal(self) -> Floats:
        """Unit normal, shape (3,)."""
        return np.cross(self.axis_u, self.axis_v)

    def _coordinates(self, points: Floats) -> tuple[Floats, Floats]:
        offset = self.centre_mm
        return (
            self.axis_u @ points - self.axis_u @ offset,
            self.axis_v @ points - self.axis_v @ offset,
        )

    def intersect(self, origin: Floats, directions: Floats) -> Floats:
        """See `Shape`: t = n.(centre - origin) / n.direction, kept where both coordinates are inside."""
        normal = self.normal
        with np.errstate(divide="ignore"):
            t = (normal @ (self.centre_mm - origin)) / (normal @ directions)
        t = np.where(np.isfinite(t) & (t > 0), t, np.inf)
        if np.isfinite(self.half_size_mm).any():
            reach = np.where(np.isfinite(t), t, 0.0)
            u, v = self._coordinates(origin[:, None] + reach * directions)
            t[(np.abs(u) > self.half_size_mm[0]) | (np.abs(v) > self.half_size_mm[1])] = np.inf
        return t

    def normals(self, points: Floats) -> Floats:
        """See `Shape`."""
        return np.broadcast_to(self.normal[:, None], points.shape)

    def paint(self, points: Floats) -> NDArray[np.int32]:
        """See `Shape`."""
        return self.painter(*self._coordinates(points))


def tilted(
    centre_mm: tuple[float, float, float],
    tilt_x_deg: float,
    tilt_y_deg: float,
    half_size_mm: tuple[float, float],
    painter: Paint,
) -> Rectangle:
    """A rectangle facing the camera, turned about its horizontal (x) and then its vertical (y) axis.

    A positive ``tilt_x_deg`` moves the lower edge away, a positive ``tilt_y_deg`` the right edge.
    """
    a, b = np.radians([tilt_x_deg, tilt_y_deg])
    axis_u = np.array([np.cos(b), 0.0, np.sin(b)])
    axis_v = np.array([-np.sin(a) * np.sin(b), np.cos(a), np.sin(a) * np.cos(b)])
    return Rectangle(np.array(centre_mm, float), axis_u, axis_v, half_size_mm, painter)


def turned(flat: Rectangle, roll_deg: float) -> Rectangle:
    """A rectangle turned in its own plane, clockwise as the camera sees it."""
    turn = np.radians(roll_deg)
    return replace(
        flat,
        axis_u=np.cos(turn) * flat.axis_u + np.sin(turn) * flat.axis_v,
        axis_v=np.cos(turn) * flat.axis_v - np.sin(turn) * flat.axis_u,
    )


@dataclass(frozen=True)
class Sphere:
    """A ball; painted by x and y of the point relative to the centre."""

    centre_mm: Floats
    radius_mm: float
    painter: Paint

    def intersect(self, origin: Floats, directions: Floats) -> Floats:
        """See `Shape`: the nearer root of ``|o + t d - c|^2 = r^2``."""
        offset = origin - self.centre_mm
        a = np.einsum("in,in->n", directions, directions)
        half_b = offset @ directions
        disc = half_b**2 - a * (offset @ offset - self.radius_mm**2)
        t = (-half_b - np.sqrt(np.maximum(disc, 0.0))) / a
        return np.where((disc >= 0) & (t > 0), t, np.inf)

    def normals(self, points: Floats) -> Floats:
        """See `Shape`."""
        return (points - self.centre_mm[:, None]) / self.radius_mm

    def paint(self, points: Floats) -> NDArray[np.int32]:
        """See `Shape`."""
        return self.painter(points[0] - self.centre_mm[0], points[1] - self.centre_mm[1])


@dataclass(frozen=True)
class Block:
    """A solid box with faces along the axes, from one corner to the other; one material."""

    low_mm: Floats
    high_mm: Floats
    material: int

    def intersect(self, origin: Floats, directions: Floats) -> Floats:
        """See `Shape`: the slab method; rays that start inside do not count."""
        with np.errstate(divide="ignore", invalid="ignore"):
            first = (self.low_mm - origin)[:, None] / directions
            second = (self.high_mm - origin)[:, None] / directions
        enter = np.fmin(first, second).max(axis=0)
        leave = np.fmax(first, second).min(axis=0)
        return np.where((enter <= leave) & (enter > 0), enter, np.inf)

    def normals(self, points: Floats) -> Floats:
        """See `Shape`: the axis whose face is nearest."""
        gap = np.minimum(np.abs(points - self.low_mm[:, None]), np.abs(points - self.high_mm[:, None]))
        result = np.zeros_like(points)
        axis = gap.argmin(axis=0)
        result[axis, np.arange(points.shape[1])] = 1.0
        return result

    def paint(self, points: Floats) -> NDArray[np.int32]:
        """See `Shape`."""
        return np.full(points.shape[1], self.material, np.int32)


@dataclass(frozen=True)
class HeightField:
    """The surface ``z = height(x, y)``, nearest at ``low_mm``, nowhere steeper than ``steepest`` (mm/mm)."""

    height: Height
    low_mm: float
    steepest: float
    painter: Paint

    def intersect(self, origin: Floats, directions: Floats) -> Floats:
        """See `Shape`.

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
        """See `Shape`: from central differences of the height, ``(dz/dx, dz/dy, -1)`` made unit."""
        x, y = points[:2]
        h = _DIFFERENCE_MM
        slope_x = (self.height(x + h, y) - self.height(x - h, y)) / (2 * h)
        slope_y = (self.height(x, y + h) - self.height(x, y - h)) / (2 * h)
        normals = np.stack([slope_x, slope_y, -np.ones_like(x)])
        return np.asarray(normals / np.linalg.norm(normals, axis=0))

    def paint(self, points: Floats) -> NDArray[np.int32]:
        """See `Shape`."""
        return self.painter(points[0], points[1])


def height_field(height: Height, half_size_mm: tuple[float, float], painter: Paint) -> HeightField:
    """A height field whose range and steepest slope are taken from a 1 mm raster of its middle part.

    Outside ``half_size_mm`` the height must be flatter and deeper than inside. A tenth is added to the slope
    and a millimetre to the range for what is between the samples.
    """
    x, y = np.meshgrid(*[np.arange(-half, half + 0.5) for half in half_size_mm])
    z = height(x.ravel(), y.ravel()).reshape(x.shape)
    slopes = np.hypot(*np.gradient(z))
    return HeightField(height, float(z.min()) - 1.0, 1.1 * float(slopes.max()) + 0.05, painter)


@dataclass(frozen=True)
class Hits:
    """First hits of n camera rays: depth (n,), normals (3, n), material (n,), lit (n,)."""

    depth_mm: Floats
    normals: Floats
    material: NDArray[np.int32]
    lit: NDArray[np.bool_]


def trace(surfaces: tuple[Shape, ...], rays: Floats, projector_centre_mm: Floats) -> Hits:
    """First hits of camera rays (3, n) with z = 1, and whether the projector's centre sees them."""
    nearest, owner = _first(surfaces, rays)
    count = rays.shape[1]
    normals = np.full((3, count), np.nan)
    material = np.full(count, -1, np.int32)
    lit = np.zeros(count, bool)
    for index, surface in enumerate(surfaces):
        mine = np.flatnonzero(owner == index)
        points = rays[:, mine] * nearest[mine]
        normals[:, mine] = _facing(surface.normals(points), rays[:, mine])
        material[mine] = surface.paint(points)
        lit[mine] = _lit(surfaces, points, normals[:, mine], projector_centre_mm)
    return Hits(np.where(owner >= 0, nearest, np.nan), normals, material, lit)


def materials_along(surfaces: tuple[Shape, ...], rays: Floats) -> NDArray[np.int32]:
    """Material of the first hits of camera rays (3, n) with z = 1; -1 where nothing is hit."""
    nearest, owner = _first(surfaces, rays)
    material = np.full(rays.shape[1], -1, np.int32)
    for index, surface in enumerate(surfaces):
        mine = np.flatnonzero(owner == index)
        material[mine] = surface.paint(rays[:, mine] * nearest[mine])
    return material


def _first(surfaces: tuple[Shape, ...], rays: Floats) -> tuple[Floats, NDArray[np.int64]]:
    """Depth of the first hit of every ray, inf for none, and which surface it is on, -1 for none."""
    nearest = np.full(rays.shape[1], np.inf)
    owner = np.full(rays.shape[1], -1)
    for index, surface in enumerate(surfaces):
        # Rays have z = 1, so that t is depth.
        t = surface.intersect(np.zeros(3), rays)
        closer = t < nearest
        nearest[closer] = t[closer]
        owner[closer] = index
    return nearest, owner


def _facing(normals: Floats, rays: Floats) -> Floats:
    """Normals turned towards the camera."""
    away = np.einsum("in,in->n", normals, rays) > 0
    return np.where(away, -normals, normals)


def _lit(surfaces: tuple[Shape, ...], points: Floats, normals: Floats, centre: Floats) -> NDArray[np.bool_]:
    """Whether points (3, n) face the projector and nothing stands between it and them."""
    beams = points - centre[:, None]
    lit = np.einsum("in,in->n", beams, normals) < 0
    for surface in surfaces:
        lit &= surface.intersect(centre, beams) > 1.0 - _SHADOW_MARGIN
    return np.asarray(lit)
