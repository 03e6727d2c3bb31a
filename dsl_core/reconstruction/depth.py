"""Triangulation of camera rays with projector columns, both lenses with distortion."""

from __future__ import annotations

import torch
from torch import Tensor

from dsl_core.model.rig import Rig
from dsl_core.optics.correspondence import projector_points, zero_order

ITERATIONS = 4


def triangulate(rig: Rig, pixels: Tensor, column_px: Tensor) -> tuple[Tensor, Tensor]:
    """Depth (mm) at flat pixel indices from projector columns (px), and its slope (mm per px).

    The start is the closed form without projector distortion (seed Eqs. 9 to 11 solved for z); Newton
    steps with the full model follow. NaN where ray and column do not meet in front of the camera.
    """
    z = _closed_form(rig, pixels, column_px)
    low, high = rig.depth_range_mm
    z = z.clip(0.3 * low, 3 * high)
    for _ in range(ITERATIONS):
        here, slope = _column_and_slope(rig, pixels, z)
        # A column is nearly linear in inverse depth, whatever the baseline: Newton's step is taken there.
        nearer = 1 + (here - column_px) / (slope * z)
        z = (z / nearer.clip(min=0.01)).clip(0.1 * low, 10 * high)
    here, slope = _column_and_slope(rig, pixels, z)
    met = (here - column_px).abs() < 0.01
    return torch.where(met, z, torch.nan), 1 / slope.abs()


def _column_and_slope(rig: Rig, pixels: Tensor, z: Tensor) -> tuple[Tensor, Tensor]:
    """Zero-order column (px) at a depth and its change per mm."""
    here = zero_order(rig, pixels, z)[0]
    ahead = zero_order(rig, pixels, z + 1.0)[0]
    slope = ahead - here
    return here, torch.where(slope.abs() < 1e-6, torch.full_like(slope, -1e-6), slope)


def _closed_form(rig: Rig, pixels: Tensor, column_px: Tensor) -> Tensor:
    far = projector_points(rig, pixels, torch.ones_like(column_px))
    tx, _, tz = rig.pose.translation_mm
    ray_x, ray_z = far.x - tx, far.z - tz
    u = (column_px - rig.projector.cx_px) / rig.projector.fx_px
    return (u * tz - tx) / (ray_x - u * ray_z)
