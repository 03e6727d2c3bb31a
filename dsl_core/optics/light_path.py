"""How the columns of a pattern become light on a pixel: line profile, blur and halo of the zero order."""

from __future__ import annotations

import math

import torch
from torch import Tensor

from dsl_core.model.rig import ProjectorResponse


def step_edge(distance_px: Tensor, blur_px: float) -> Tensor:
    """Integral of the Gaussian blur up to a distance (px) from a step; same shape, 0..1."""
    return 0.5 * (1 + torch.erf(distance_px * (1 / (math.sqrt(2) * blur_px))))


def halo_integral(distance_px: Tensor, response: ProjectorResponse) -> Tensor:
    """Integral of the halo ``peak * exp(-|d| / decay)`` from minus infinity to a distance (px)."""
    tail = (
        response.halo_peak_per_px
        * response.halo_decay_px
        * torch.exp(-distance_px.abs() / response.halo_decay_px)
    )
    full = 2 * response.halo_peak_per_px * response.halo_decay_px
    return torch.where(distance_px < 0, tail, full - tail)


def zero_order_profile(
    columns: Tensor, start_px: float, stop_px: float, response: ProjectorResponse
) -> Tensor:
    """Light of the zero order at projector columns from a band of columns between two edges (px).

    Box blurred by the Gaussian plus the halo; 1 inside a wide band.
    """
    near, far = columns - start_px, columns - stop_px
    direct = step_edge(near, response.blur_px) - step_edge(far, response.blur_px)
    return direct + halo_integral(near, response) - halo_integral(far, response)


def halo_of_line(distance_px: Tensor, width_px: float, response: ProjectorResponse) -> Tensor:
    """Halo of a line far from its own columns, relative to the zero-order amplitude; any shape."""
    decay = response.halo_decay_px
    return (response.halo_peak_per_px * width_px) * torch.exp(distance_px.abs() * (-1 / decay))
