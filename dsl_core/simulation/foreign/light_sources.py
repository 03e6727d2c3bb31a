"""Where the light of every part of a picture comes from: columns and rows of orders and wavelengths."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from numpy.polynomial.chebyshev import chebpts1, chebvander
from numpy.typing import NDArray
from torch import Tensor

from dsl_core.model.rig import Rig
from dsl_core.optics.correspondence import projector_points
from dsl_core.optics.grating import Vectors
from dsl_core.optics.pinhole import project
from dsl_core.simulation.foreign.film_shape import BentFilm
from dsl_core.simulation.foreign.lenses import projector_magnification
from dsl_core.simulation.foreign.variants import Foreign

Floats = NDArray[np.float64]
#: Wavelengths at which light is sampled, nm: half a projector pixel or less apart in all orders.
FINE_NM = np.arange(400.0, 700.25, 0.5)
#: Wavelengths at which rays are traced; between them columns follow a polynomial to below 1e-4 px.
TRACED = 9


@dataclass(frozen=True)
class Sources:
    """Columns and rows (px) of an order at the traced wavelengths for parts ``active``, (TRACED, active)."""

    order: int
    active: Tensor
    columns: Tensor
    rows: Tensor

    def part(self, some: slice) -> Sources:
        """The same for some of the active parts."""
        return Sources(self.order, self.active[some], self.columns[:, some], self.rows[:, some])

    def at(self, wavelengths_nm: Floats) -> tuple[Tensor, Tensor]:
        """Columns and rows (px) at wavelengths, each (wavelengths, active)."""
        matrix = torch.as_tensor(_interpolation(wavelengths_nm))
        return matrix @ self.columns, matrix @ self.rows


def traced_nm() -> Floats:
    """Wavelengths at which rays are traced."""
    return np.asarray(550.0 + 150.0 * chebpts1(TRACED))


def _interpolation(wavelengths_nm: Floats) -> Floats:
    """Matrix from values at the traced wavelengths to values at others."""
    at_nodes = chebvander(chebpts1(TRACED), TRACED - 1)
    return np.asarray(chebvander((wavelengths_nm - 550.0) / 150.0, TRACED - 1) @ np.linalg.inv(at_nodes))


def trace(rig: Rig, foreign: Foreign, order: int, pixels: Tensor, depth_mm: Tensor, lit: Tensor) -> Sources:
    """Sources of an order at flat pixel indices (P,) and depths (P,), as far as they are ``lit``.

    Active are those that light from inside the projector's frame, or from its margin, can reach.
    """
    lens = rig.projector
    nm = torch.as_tensor(traced_nm())[:, None]
    if order == 0:
        point = projector_points(rig, pixels, depth_mm)
        direction = Vectors(*(q.expand(TRACED, -1) for q in point))
    else:
        point = projector_points(rig, pixels, depth_mm)
        direction = BentFilm(rig, foreign).incoming(point, order, nm)
    column, row = project(lens, *direction)
    magnified = torch.as_tensor(projector_magnification(traced_nm(), foreign))[:, None]
    column = lens.cx_px + (column - lens.cx_px) * magnified
    row = lens.cy_px + (row - lens.cy_px) * magnified
    margin = 20.0
    seen = (column.amax(0) > -margin) & (column.amin(0) < lens.width_px + margin)
    seen &= (row.amax(0) > -margin) & (row.amin(0) < lens.height_px + margin)
    active = torch.nonzero(seen & lit).ravel()
    return Sources(order, active, column[:, active].contiguous(), row[:, active].contiguous())
