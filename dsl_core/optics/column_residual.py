"""The smooth correction of first-order columns, evaluated for many pixels at once."""

from __future__ import annotations

import torch
from torch import Tensor

from dsl_core.model.rig import ColumnResidual, Range


def residual_columns(
    residual: ColumnResidual,
    camera_px: tuple[Tensor, Tensor],
    depth_mm: Tensor,
    order: int,
    wavelengths_nm: Tensor,
) -> Tensor | None:
    """Correction (px) of shape (wavelengths, pixels); None where there is nothing to add.

    ``camera_px`` are columns and rows of the pixels, like ``depth_mm`` of shape (pixels,).
    """
    if not residual.degrees or order not in residual.orders:
        return None
    coefficients = residual.coefficients_px[residual.orders.index(order)]
    near, far = residual.depth_range_mm
    highest = [max(term[axis] for term in residual.degrees) for axis in range(4)]
    x, y, z = (
        chebyshev(scaled(values, limits), degree)
        for values, limits, degree in (
            (camera_px[0], residual.column_range_px, highest[0]),
            (camera_px[1], residual.row_range_px, highest[1]),
            (1 / depth_mm, (1 / far, 1 / near), highest[2]),
        )
    )
    by_wavelength = torch.zeros((highest[3] + 1, len(depth_mm)), device=depth_mm.device, dtype=depth_mm.dtype)
    for (i, j, k, degree), value in zip(residual.degrees, coefficients, strict=True):
        by_wavelength[degree] += value * x[i] * y[j] * z[k]
    nm = scaled(wavelengths_nm.to(depth_mm), residual.wavelength_range_nm)
    return torch.stack(chebyshev(nm, highest[3]), 1) @ by_wavelength


def scaled(values: Tensor, limits: Range) -> Tensor:
    """Values mapped from their range to -1..1 and held at its ends, same shape."""
    low, high = limits
    return ((values - low) * (2 / (high - low)) - 1).clip(-1, 1)


def chebyshev(x: Tensor, degree: int) -> list[Tensor]:
    """Chebyshev polynomials of degree zero up to and including a degree at x (-1..1)."""
    found = [torch.ones_like(x), x]
    for _ in range(degree - 1):
        found.append(2 * x * found[-1] - found[-2])
    return found[: degree + 1]
