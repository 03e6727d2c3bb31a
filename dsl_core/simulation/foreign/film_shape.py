"""Films bent otherwise than as cylinders, and the ray through them to a point.

The film's surface is ``z = distance + bend u^2 / 2 + shape(u, v)`` with u across the lines and v along them,
from the middle of the frame. An S and a twist are shapes that the record of a calibration can have
(`dsl_core.model.rig.FilmShape`); no record has a dent. Of the S and the twist the linear part that best fits
is taken out, which a calibration would have found as a tilt.
"""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from dsl_core.model.rig import Rig
from dsl_core.optics.grating import FilmFrame, Vectors
from dsl_core.simulation.foreign.variants import Foreign

#: Largest slope of the S at the frame's side, and of the twist at the frame's top and bottom: as steep as the
#: strongest usual bend of a drawn rig is there.
S_SLOPE, TWIST_SLOPE = 0.04, 0.04
#: Largest slope of the dent, where its middle is, and its radius, in halves of the frame across the lines.
DENT_SLOPE, DENT_U, DENT_RADIUS = 0.04, 0.35, 0.3
#: The film is close and the scene far: each step shrinks the error about twentyfold.
STEPS = 12


class BentFilm:
    """A film and what is foreign about its shape."""

    def __init__(self, rig: Rig, foreign: Foreign) -> None:
        self.frame = FilmFrame.of(rig.film)
        lens = rig.projector
        at = rig.film.distance_mm
        self.half_u = at * max(lens.cx_px, lens.width_px - lens.cx_px) / lens.fx_px
        self.middle_v = at * ((lens.height_px - 1) / 2 - lens.cy_px) / lens.fy_px
        half_v = at * lens.height_px / 2 / lens.fy_px
        # d/du of k (u^3 - 3/5 half^2 u) is 2.4 k half^2 at the side.
        self.s_per_mm2 = S_SLOPE / (2.4 * self.half_u**2) if foreign.has("bend-s") else 0.0
        self.twist_per_mm = TWIST_SLOPE / half_v if foreign.has("bend-twist") else 0.0
        self.dent_radius_mm = DENT_RADIUS * self.half_u
        # The flank of a bell is steepest one radius from its middle.
        steep = DENT_SLOPE * np.exp(0.5) * self.dent_radius_mm
        self.dent_mm = float(steep) if foreign.has("film-dent") else 0.0

    def sag(self, u: Tensor, v: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Height (mm) of the surface at places on the film (mm), and its slopes along u and v."""
        bend, s, twist = self.frame.bend_per_mm, self.s_per_mm2, self.twist_per_mm
        v = v - self.middle_v
        linear = 0.6 * self.half_u**2
        height = 0.5 * bend * u * u + s * (u * u - linear) * u + twist * u * v
        slope_u, slope_v = bend * u + s * (3 * u * u - linear) + twist * v, twist * u
        if not self.dent_mm:
            return height, slope_u, slope_v
        away, square = u - DENT_U * self.half_u, self.dent_radius_mm**2
        dent = self.dent_mm * torch.exp(-0.5 * (away * away + v * v) / square)
        return height + dent, slope_u - dent * away / square, slope_v - dent * v / square

    def incoming(self, point: Vectors, order: int, wavelengths_nm: Tensor) -> Vectors:
        """Direction from the projector's centre that reaches points (mm) through an order.

        Vectors in projector coordinates; shapes of points and wavelengths broadcast. Light keeps its
        component along the lines and gets ``order wavelength / period`` across them, both in the surface.
        """
        target = self.frame.to_film(point)
        origin = self.frame.axes @ np.array([0.0, 0.0, self.frame.distance_mm])
        gain = order * wavelengths_nm / self.frame.period_nm
        x, y = target.x * (origin[2] / target.z), target.y * (origin[2] / target.z)
        found = target
        for _ in range(STEPS):
            height, slope_u, slope_v = self.sag(x - origin[0], y - origin[1])
            out = _unit(target.x - x, target.y - y, target.z - origin[2] - height)
            across = _unit(torch.ones_like(slope_u), torch.zeros_like(slope_u), slope_u)
            normal = _unit(-slope_u, -slope_v, torch.ones_like(slope_u))
            along = _cross(normal, across)
            a = (_dot(out, across) + gain).clip(-0.999, 0.999)
            b = _dot(out, along)
            c = torch.sqrt((1 - a * a - b * b).clip(min=1e-3))
            found = Vectors(*(a * p + b * q + c * r for p, q, r in zip(across, along, normal, strict=True)))
            reach = (origin[2] + height) / found.z
            x, y = found.x * reach, found.y * reach
        return self.frame.to_projector(found)


def _unit(x: Tensor, y: Tensor, z: Tensor) -> Vectors:
    length = torch.sqrt(x * x + y * y + z * z)
    return Vectors(x / length, y / length, z / length)


def _dot(p: Vectors, q: Vectors) -> Tensor:
    return p.x * q.x + p.y * q.y + p.z * q.z


def _cross(p: Vectors, q: Vectors) -> Vectors:
    return Vectors(p.y * q.z - p.z * q.y, p.z * q.x - p.x * q.z, p.x * q.y - p.y * q.x)
