"""Light of a projected line against the distance in columns: in the zero order, and on a band."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.special import erf
from torch import Tensor

from dsl_core.model.projector.line_spread import REACH, LineSpread, Spread
from dsl_core.model.rig import ProjectorResponse
from dsl_core.optics.spread.curves import EvenTable, density, mixed, reach_px, step_response, step_table

#: Samples a column of the tabulated profile; linear interpolation is avoided at an error below 1e-3.
SAMPLES = 256
#: Widths of a Gaussian blur beyond a line's band at which its profile ends.
ENDS = 2.2


def band_profile(
    distance_px: NDArray[np.float64], width_px: float, spread: Spread, band_px: float
) -> NDArray[np.float64]:
    """Mean light of a line of ``width_px`` over a band's triangle of half width ``band_px``.

    Box convolved with the spread and the unit-area triangle. Same shape as the distance.
    """
    if isinstance(spread, LineSpread):
        grid, values = _band_curve(width_px, spread, band_px)
        return np.interp(distance_px, grid, values, 0.0, 0.0)
    return _gaussian_band(distance_px, width_px, spread, band_px)


@lru_cache(maxsize=64)
def _band_curve(
    width_px: float, spread: LineSpread, band_px: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The profile of a measured spread on an even grid of distances (px)."""
    reach = width_px / 2 + band_px + REACH * spread.core_px
    return mixed(spread, reach, lambda x: _gaussian_band(x, width_px, spread.core_px, band_px))


def _gaussian_band(
    distance_px: NDArray[np.float64], width_px: float, blur_px: float, band_px: float
) -> NDArray[np.float64]:
    """The profile of a Gaussian blur.

    In closed form: the second difference of the Gaussian's third integral, for both edges of the line.
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
        self, width_px: float, spread: Spread, band_px: float, device: torch.device, dtype: torch.dtype
    ) -> None:
        ends_px = reach_px(spread) if isinstance(spread, LineSpread) else ENDS * spread
        self.support_px = math.ceil(2 * (width_px / 2 + band_px + ends_px)) / 2
        count = int(2 * self.support_px * SAMPLES) + 1
        grid = np.linspace(-self.support_px, self.support_px, count)
        values = band_profile(grid, width_px, spread, band_px)
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


def step_edge(distance_px: Tensor, spread: Spread) -> Tensor:
    """Integral of the spread up to a distance (px) from a step; same shape, 0..1."""
    if isinstance(spread, LineSpread):
        return torch.as_tensor(step_response(spread, distance_px.double().cpu().numpy())).to(distance_px)
    return 0.5 * (1 + torch.erf(distance_px * (1 / (math.sqrt(2) * spread))))


def halo_integral(distance_px: Tensor, response: ProjectorResponse) -> Tensor:
    """Integral of the halo ``peak * exp(-|d| / decay)`` from minus infinity to distances (px), same shape."""
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

    Box times the line spread, plus the halo; 1 inside a wide band.
    """
    near, far = columns - start_px, columns - stop_px
    direct = step_edge(near, response.line_spread) - step_edge(far, response.line_spread)
    return direct + halo_of_band(columns, start_px, stop_px, response)


def halo_of_band(columns: Tensor, start_px: float, stop_px: float, response: ProjectorResponse) -> Tensor:
    """The part of `zero_order_profile` that is halo."""
    return halo_integral(columns - start_px, response) - halo_integral(columns - stop_px, response)


class LineTable:
    """A line's profile in the zero order and its slope, tabulated: many times as fast as working them out."""

    def __init__(
        self,
        width_px: float,
        response: ProjectorResponse,
        reach_px: float,
        like: Tensor,
        widths: Tensor | None = None,
    ) -> None:
        """For distances up to ``reach_px`` from the line's middle, in the precision of ``like``.

        ``widths`` (pixels,) are those of the spread relative to the response's, pixel by pixel.
        """
        self._half_px, self._widths, spread = width_px / 2, widths, response.line_spread
        half = math.ceil(reach_px * SAMPLES)
        distance = np.arange(-half, half + 1) / SAMPLES
        near, far = distance + self._half_px, distance - self._half_px
        halo = [halo_integral(torch.as_tensor(edge), response).numpy() for edge in (near, far)]
        slopes = (np.exp(-np.abs(edge) / response.halo_decay_px) for edge in (near, far))
        curves = [halo[0] - halo[1], response.halo_peak_per_px * np.subtract(*slopes)]
        if widths is None:
            curves[0] += step_response(spread, near) - step_response(spread, far)
            curves[1] += density(spread, near) - density(spread, far)
        else:
            # The light of a step depends on the distance in widths alone, so that one table serves all.
            self._step = step_table(spread, like)
        self._table = EvenTable(float(distance[0]), 1 / SAMPLES, curves, like)

    def at(self, distance_px: Tensor) -> tuple[Tensor, Tensor]:
        """Profile and its slope (1/px) at distances from the line's middle, each (..., pixels) as given."""
        profile, slope = self._table.at(distance_px)
        if self._widths is not None:
            for edge_px, sign in ((self._half_px, 1), (-self._half_px, -1)):
                light, narrow = self._step.at((distance_px + edge_px) / self._widths)
                profile, slope = profile + sign * light, slope + sign * narrow / self._widths
        return profile, slope


def halo_of_line(distance_px: Tensor, width_px: float, response: ProjectorResponse) -> Tensor:
    """Halo of a line far from its own columns, relative to the zero-order amplitude; any shape."""
    decay = response.halo_decay_px
    return (response.halo_peak_per_px * width_px) * torch.exp(distance_px.abs() * (-1 / decay))
