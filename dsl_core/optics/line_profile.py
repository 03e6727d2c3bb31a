"""Light of a projected line against the distance in columns: in the zero order, and on a band."""

from __future__ import annotations

import math

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.special import erf
from torch import Tensor

from dsl_core.model.rig import ProjectorResponse

#: Samples a column of the tabulated profile; linear interpolation is avoided at an error below 1e-3.
SAMPLES = 256


def band_profile(
    distance_px: NDArray[np.float64], width_px: float, blur_px: float, band_px: float
) -> NDArray[np.float64]:
    """Mean light of a line of ``width_px`` over a band's triangle of half width ``band_px``.

    Box convolved with the Gaussian blur and the unit-area triangle, in closed form: the second
    difference of the Gaussian's third integral, for both edges of the line. Same shape as the distance.
    """

    def third(x: NDArray[np.float64]) -> NDArray[np.float64]:
        # Third integral of the Gaussian density: half of E[max(x - noise, 0)^2].
        t = x / (math.sqrt(2) * blur_px)
        density = np.exp(-(t**2)) / (math.sqrt(2 * math.pi) * blur_px)
        return 0.5 * ((x**2 + blur_px**2) * 0.5 * (1 + erf(t)) + x * blur_px**2 * density)

    def edge(x: NDArray[np.float64]) -> NDArray[np.float64]:
        return (third(x + band_px) - 2 * third(x) + third(x - band_px)) / band_px**2

    return np.asarray(edge(distance_px + width_px / 2) - edge(distance_px - width_px / 2))


class ProfileTable:
    """A tabulated profile with compact support, looked up for many distances at once."""

    def __init__(
        self, width_px: float, blur_px: float, band_px: float, device: torch.device, dtype: torch.dtype
    ) -> None:
        self.support_px = math.ceil(2 * (width_px / 2 + band_px + 2.2 * blur_px)) / 2
        count = int(2 * self.support_px * SAMPLES) + 1
        grid = np.linspace(-self.support_px, self.support_px, count)
        values = band_profile(grid, width_px, blur_px, band_px)
        # A zero at each end serves every distance beyond the support.
        values[0] = values[-1] = 0.0
        self.values = torch.as_tensor(values, device=device, dtype=dtype)

    def at(self, distance_px: Tensor) -> Tensor:
        """Profile at distances (px), same shape; zero beyond the support."""
        index = (distance_px + self.support_px).mul_(SAMPLES).add_(0.5).clip_(0, len(self.values) - 1).int()
        return self.values.index_select(0, index.reshape(-1)).reshape(index.shape)

    def overlaps(self, spacing_px: float, slack_px: float) -> NDArray[np.float64]:
        """Integrated products of profiles one, two, ... spacings less a slack apart, relative to none."""
        values = self.values.double().cpu().numpy()
        lags = np.arange(spacing_px, len(values) / SAMPLES + slack_px, spacing_px) - slack_px
        shifts = np.maximum((lags * SAMPLES).astype(int), 1)
        products = [values[s:] @ values[:-s] for s in shifts]
        return np.asarray(products, np.float64) / float(values @ values)


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
