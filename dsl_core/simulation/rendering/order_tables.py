"""Where the light of a diffraction order at each pixel comes from, and what it brings, as look-up tables."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from dsl_core.model.rig import Rig
from dsl_core.optics.correspondence import CHUNK, GratingModel, chebyshev_nodes, interpolation_matrix, like
from dsl_core.simulation.rendering.order_reach import may_reach
from dsl_core.simulation.rendering.spectral_tables import NM, Slicing, SpectralTables

#: Degree of the polynomial from column to wavelength. With 480 lines/mm it is wrong by up to 0.1 nm in first
#: orders and 0.6 nm in second ones.
DEGREE = 6


@dataclass(frozen=True)
class OrderTables:
    """One order's geometry at every pixel that it can reach, and its spectra.

    ``sigma_nm`` is the projector's blur as a width in wavelength.
    """

    order: int
    active: Tensor  # (A,) indices into the renderer's pixels
    node_columns: Tensor  # (nodes, A)
    node_rows: Tensor  # (nodes, A)
    middle_px: Tensor  # (A,) column of the middle wavelength
    spread_px: Tensor  # (A,) scale of the columns in the inverse polynomial
    inverse: Tensor  # (DEGREE + 1, A): wavelength minus middle, as polynomial of scaled column
    limits_nm: tuple[Tensor, Tensor]  # wavelengths whose row is inside the frame
    reach_px: tuple[Tensor, Tensor]  # smallest and largest column
    sigma_nm: float
    spectra: SpectralTables

    @classmethod
    def make(
        cls,
        rig: Rig,
        order: int,
        pixels: Tensor,
        depth_mm: Tensor,
        lit: Tensor,
        reflectance: NDArray[np.float64],
        slicing: Slicing,
    ) -> OrderTables:
        """Tables of an order for pixels (P,), flat indices, at depths (P,), as far as they are ``lit``."""
        nodes = chebyshev_nodes(NM[0], NM[-1])
        near = may_reach(rig, order, pixels, depth_mm, lit, NM[[0, -1]])
        columns, rows = GratingModel(rig).exact(pixels[near], depth_mm[near], order, nodes)
        w, h = rig.projector.width_px, rig.projector.height_px
        ends = like(interpolation_matrix(nodes, np.array([NM[0], NM.mean(), NM[-1]])), columns)
        at_ends = ends @ columns
        low, high = at_ends[[0, 2]].amin(0), at_ends[[0, 2]].amax(0)
        inside = torch.nonzero((high > -2) & (low < w + 1)).ravel()
        columns, rows, low, high = columns[:, inside], rows[:, inside], low[inside], high[inside]
        middle = at_ends[1, inside]
        spread = 1.02 * torch.maximum(high - middle, middle - low)
        dispersion = float((high - low).median()) / (NM[-1] - NM[0]) if len(inside) else 1.0
        sigma_nm = rig.projector_response.blur_px / dispersion
        return cls(
            order,
            near[inside],
            columns,
            rows,
            middle,
            spread,
            _inverse(nodes, columns, middle, spread),
            _row_limits(ends @ rows, h),
            (low, high),
            sigma_nm,
            SpectralTables.make(rig, order, reflectance, sigma_nm, slicing, pixels.device),
        )


def _inverse(nodes: NDArray[np.float64], columns: Tensor, middle: Tensor, spread: Tensor) -> Tensor:
    """Polynomial coefficients of wavelength over scaled column, (DEGREE + 1, A), of columns (nodes, A)."""
    inverse = torch.empty((DEGREE + 1, columns.shape[1]), device=columns.device, dtype=columns.dtype)
    # In chunks that stay in the cache, a quarter of the time: the first picture of a live view waits for it.
    for i in range(0, columns.shape[1], CHUNK):
        part = slice(i, i + CHUNK)
        inverse[:, part] = _inverse_of(nodes, columns[:, part], middle[part], spread[part])
    return inverse


def _inverse_of(nodes: NDArray[np.float64], columns: Tensor, middle: Tensor, spread: Tensor) -> Tensor:
    """The same of a few pixels, by Newton's method at fixed columns."""
    offsets = chebyshev_nodes(-1.0, 1.0, DEGREE + 1)
    to_power = np.linalg.inv(np.vander((nodes - NM.mean()) / 150, len(nodes), increasing=True))
    forward = like(to_power, columns) @ columns
    target = middle + like(offsets, columns)[:, None] * spread
    t = (target - middle) / forward[1]
    for _ in range(4):
        value, derivative = _horner(forward, t)
        t = (t - (value - target) / derivative).clip(-1.3, 1.3)
    return like(np.linalg.inv(np.vander(offsets, DEGREE + 1, increasing=True)), columns) @ (150 * t)


def _horner(coefficients: Tensor, t: Tensor) -> tuple[Tensor, Tensor]:
    """Value and derivative of a polynomial with rising coefficients."""
    value, derivative = coefficients[-1].expand_as(t), torch.zeros_like(t)
    for c in coefficients[:-1].flip(0):
        derivative = derivative * t + value
        value = value * t + c
    return value, derivative


def _row_limits(rows: Tensor, height: int) -> tuple[Tensor, Tensor]:
    """Wavelengths whose row is inside the frame, from rows at the first, middle and last wavelength."""
    first, last = rows[0], rows[2]
    slope = (last - first) / float(NM[-1] - NM[0])
    slope = torch.where(slope.abs() < 1e-6, torch.full_like(slope, 1e-6), slope)
    top = (-0.5 - first) / slope + float(NM[0])
    bottom = (height - 0.5 - first) / slope + float(NM[0])
    low = torch.minimum(top, bottom).clip(float(NM[0]), float(NM[-1]))
    high = torch.maximum(top, bottom).clip(float(NM[0]), float(NM[-1]))
    return low, high
