"""The diffraction film: grating equation in direction cosines, and the ray that reaches a point.

In the film's local frame (x across the lines, y along them, z through the film) light of direction
cosines (a, b, c) leaves order m with::

    a' = a - m * wavelength / period,    b' = b,    c' = sqrt(1 - a'^2 - b'^2)

That is the grating equation for any incidence (J. E. Harvey and C. L. Vernold, "Description of diffraction
grating behavior in direction cosine space", Appl. Opt. 37, 1998), with a sign that counts orders as the model
package says: order +1 comes from columns right of the zero order.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from dsl_core.model.rig import Film, FilmShape

#: Steps of the search for the place on the film. Where that is close to the projector and the scene far, each
#: leaves a hundredth of the error, 3e-5 px in the end. Where the film is further away than `NEAR` of the way
#: between film and scene, each may leave a tenth: more of them end below 1e-3 px.
STEPS, MORE_STEPS, NEAR = 4, 8, 0.1


class Vectors(NamedTuple):
    """Three components of a field of vectors, each of the same shape."""

    x: Tensor
    y: Tensor
    z: Tensor


@dataclass(frozen=True)
class FilmFrame:
    """The film's pose in projector coordinates and its form: rotation rows are its x, y and normal axes."""

    axes: NDArray[np.float64]
    distance_mm: float
    bend_per_mm: float
    period_nm: float
    shape: FilmShape | None = None

    @classmethod
    def of(cls, film: Film) -> FilmFrame:
        """Pose of a film record: roll about the normal, then tilts about x and y."""
        ax, ay, az = np.radians([film.tilt_x_deg, film.tilt_y_deg, film.roll_deg])
        cx, sx, cy, sy, cz, sz = np.cos(ax), np.sin(ax), np.cos(ay), np.sin(ay), np.cos(az), np.sin(az)
        rx = np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
        ry = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
        rz = np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]])
        return cls((ry @ rx @ rz).T, film.distance_mm, film.bend_per_mm, film.period_nm, film.shape)

    def surface(self, u: Tensor, v: Tensor) -> tuple[Tensor, Tensor, Tensor | None]:
        """Height (mm) of the film at places across and along its lines (mm), and its slopes, same shape.

        The second slope is None for a cylinder, which has none.
        """
        height, slope = 0.5 * self.bend_per_mm * u * u, self.bend_per_mm * u
        if self.shape is None:
            return height, slope, None
        uv, vv, uuu, uuv, uvv, vvv = self.shape.factors
        v = v - self.shape.middle_mm
        height = height + v * (uv * u + vv * v) + u * u * (uuu * u + uuv * v) + v * v * (uvv * u + vvv * v)
        slope = slope + v * (uv + 2 * uuv * u + uvv * v) + 3 * uuu * u * u
        along = u * (uv + uuv * u + 2 * uvv * v) + v * (2 * vv + 3 * vvv * v)
        return height, slope, along

    def to_film(self, p: Vectors) -> Vectors:
        """Rotate projector coordinates into the film's axes."""
        r = self.axes
        return Vectors(*(float(q[0]) * p.x + float(q[1]) * p.y + float(q[2]) * p.z for q in r))

    def to_projector(self, p: Vectors) -> Vectors:
        """Rotate film axes back into projector coordinates."""
        r = self.axes.T
        return Vectors(*(float(q[0]) * p.x + float(q[1]) * p.y + float(q[2]) * p.z for q in r))


def incoming_direction(frame: FilmFrame, point: Vectors, order: int, wavelength_nm: Tensor) -> Vectors:
    """Direction in which light must leave the projector's centre to reach a point through an order.

    ``point`` is in projector coordinates (mm); shapes broadcast with ``wavelength_nm``. The result is in
    projector coordinates. Solved by Newton steps over the place where the ray meets the film, with the
    slopes of a flat one.
    """
    target = frame.to_film(point)
    # Where the projector's axis meets the film, in film axes.
    origin = frame.axes @ np.array([0.0, 0.0, frame.distance_mm])
    shift = order * wavelength_nm / frame.period_nm
    scale = origin[2] / target.z
    film_x, film_y = target.x * scale, target.y * scale
    direction = target
    far = (origin[2] < NEAR * (target.z - origin[2])) | target.z.isnan()
    for _ in range(STEPS if bool(far.all()) else MORE_STEPS):
        sag, slope, slope_along = frame.surface(film_x - origin[0], film_y - origin[1])
        dx, dy, dz = target.x - film_x, target.y - film_y, target.z - (origin[2] + sag)
        inverse = torch.rsqrt(dx * dx + dy * dy + dz * dz)
        # Local frame on the bent film: x axis (1, 0, slope), normal (-slope, 0, 1), both normalised.
        unit = torch.rsqrt(1 + slope * slope)
        a_out = (dx + slope * dz) * unit * inverse
        b = dy * inverse
        if slope_along is not None:
            # There the film rises along the lines too: its frame is turned about that x axis.
            rise = slope_along * unit
            turn = torch.rsqrt(1 + rise * rise)
            b = (b + rise * (dz - slope * dx) * unit * inverse) * turn
        a = a_out + shift
        # Evanescent orders end at grazing incidence, far outside any frame, instead of NaN.
        a = a.clip(-0.999, 0.999)
        c = torch.sqrt((1 - a * a - b * b).clip(min=1e-3))
        if slope_along is not None:
            b, c = (b - rise * c) * turn, (c + rise * b) * turn
        direction = Vectors((a - slope * c) * unit, b, (slope * a + c) * unit)
        reach = (origin[2] + sag) / direction.z
        # By how much the place found moves against the place tried, where the film is flat.
        back = origin[2] * inverse * (1 - b * b) / (c * c * c)
        film_x = film_x + (direction.x * reach - film_x) / (1 + back * (1 - a_out * a_out))
        film_y = film_y + (direction.y * reach - film_y) / (1 + back * (1 - a * a))
    return frame.to_projector(direction)
