"""How much a band of a pixel is lit by a projected line, as a function of their distance in columns."""

from __future__ import annotations

import math

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.special import erf
from torch import Tensor

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
