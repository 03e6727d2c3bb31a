"""The camera's signal as a linear function of a pixel's reflectance, for any pattern set.

For reflectance H at bands j, colour c, frame k and a pixel of shading s (the project's model equation)::

    y_ck = s * sum_m sum_j sum_l moment_mclj * light_mlk(q_m(j)) * H_j

``moment`` is the rig's response to LED l integrated over a band's hat, ``light`` the pattern's radiance at
the column that lights the pixel through order m, blurred by the projector and, in first orders, by the
width of a band. The operator comes as products with H, and as matrices.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from dsl_core.model.rig import ProjectorResponse
from dsl_core.optics.correspondence import like
from dsl_core.optics.lines.profile import band_profile, zero_order_profile

#: Samples a column, and columns beyond each edge of the frame over which a line's blurred light dies away.
OVERSAMPLE, MARGIN_PX = 4, 16


@dataclass(frozen=True)
class OrderPath:
    """One order's way to some pixels.

    ``columns_px`` and ``inside`` (whether the light starts inside the frame) have shape (bands, pixels), or
    (1, pixels) for the zero order, where all bands share a column. ``moments`` has shape (3 channels, 3 LEDs,
    bands), DN per ms; ``band_px`` is the half width of a band's triangle, 0 for the zero order.
    """

    columns_px: Tensor
    inside: Tensor
    moments: NDArray[np.float64]
    band_px: float


def one_if_grey(profiles: NDArray[np.float64]) -> NDArray[np.float64]:
    """Profiles (frames, width, LEDs) of one LED for all, where patterns are grey."""
    return profiles[..., :1] if bool((profiles == profiles[..., :1]).all()) else profiles


class BlurredProfiles:
    """Column profiles of a pattern set, blurred, looked up at columns."""

    def __init__(
        self, response: ProjectorResponse, profiles: NDArray[np.float64], band_px: float, other: Tensor
    ) -> None:
        """Blur ``profiles`` (frames, width, LEDs): for the zero order (``band_px`` 0, halo) or a band."""
        width = profiles.shape[1]
        samples = (width + 2 * MARGIN_PX) * OVERSAMPLE
        # A sample and a column enter only by their distance, so each distance is worked out once.
        steps = np.arange(samples + OVERSAMPLE * (width - 1)) - OVERSAMPLE * (width - 1)
        distance = (steps + 0.5) / OVERSAMPLE - 0.5 - MARGIN_PX
        if band_px == 0:
            light = zero_order_profile(torch.as_tensor(distance), -0.5, 0.5, response)
        else:
            light = torch.as_tensor(band_profile(distance, 1.0, response.line_spread, band_px))
        shown = torch.as_tensor(profiles, dtype=torch.float64, device=other.device).permute(2, 0, 1)
        apart = shown.new_zeros((*shown.shape[:2], OVERSAMPLE * (width - 1) + 1))
        apart[..., ::OVERSAMPLE] = shown
        # Each column's light, added up: a convolution, of which what wraps around is not looked at.
        spread = torch.fft.rfft(light.to(shown)) * torch.fft.rfft(apart, n=len(light))
        table = torch.fft.irfft(spread, n=len(light))[..., -samples:]
        self.table: Tensor = table.permute(2, 0, 1).to(other).contiguous()

    def at(self, columns_px: Tensor) -> Tensor:
        """Light at columns of shape (pixels,): (pixels, LEDs, frames); almost none far outside the frame."""
        position = ((columns_px + 0.5 + MARGIN_PX) * OVERSAMPLE - 0.5).clip(0, len(self.table) - 1.001)
        whole = position.long()
        low = self.table[whole]
        return low + (position - whole)[:, None, None] * (self.table[whole + 1] - low)


class ImageFormation:
    """The operator of some pixels, from reflectance (bands, pixels) to DN per ms (3, frames, pixels)."""

    def __init__(
        self,
        response: ProjectorResponse,
        profiles: NDArray[np.float64],
        paths: list[OrderPath],
        shading: Tensor,
        light: Callable[[float], BlurredProfiles] | None = None,
    ) -> None:
        """``profiles`` (frames, width, LEDs): radiance relative to full drive; ``shading`` is (pixels,).

        ``light`` gives the blurred profiles of a band's half width where they are known already.
        """
        profiles = one_if_grey(profiles)
        if profiles.shape[2] == 1:
            # Grey patterns light all LEDs alike: one stands for their sum.
            paths = [replace(path, moments=path.moments.sum(1, keepdims=True)) for path in paths]
        self.paths, self.shading, self.frames = paths, shading, len(profiles)
        self.bands = max(path.moments.shape[2] for path in paths)
        light = light or (lambda band_px: BlurredProfiles(response, profiles, band_px, shading))
        self._light = {path.band_px: light(path.band_px) for path in paths}

    def forward(self, reflectance: Tensor) -> Tensor:
        """Signals (3, frames, pixels) of reflectance (bands, pixels)."""
        out = torch.zeros(
            (3, self.frames, len(self.shading)), device=reflectance.device, dtype=reflectance.dtype
        )
        for bands, light, moments in self.terms():
            # Response of each LED to the reflectance of these bands, (3, LEDs, pixels).
            seen = torch.einsum("clj,jp->clp", moments, reflectance[bands])
            out += torch.einsum("clp,plf->cfp", seen, light)
        return out

    def matrix_of(self, colour: Tensor) -> Tensor:
        """The operator of one colour of each pixel, (pixels, frames, bands): ``colour`` (pixels,), 0 to 2."""
        out = torch.zeros((len(self.shading), self.frames, self.bands)).to(self.shading)
        for bands, light, moments in self.terms():
            out[..., bands] += torch.einsum("plf,plj->pfj", light, moments[colour])
        return out

    def matrix(self) -> Tensor:
        """The operator of each pixel, (pixels, 3, frames, bands)."""
        out = torch.zeros((len(self.shading), 3, self.frames, self.bands)).to(self.shading)
        for bands, light, moments in self.terms():
            out[..., bands] += torch.einsum("plf,clj->pcfj", light, moments)
        return out

    def terms(self) -> Iterator[tuple[slice, Tensor, Tensor]]:
        """Bands that share a column, their light (pixels, LEDs, frames) with shading, their moments."""
        for path in self.paths:
            moments, blurred = like(path.moments, self.shading), self._light[path.band_px]
            shared = len(path.columns_px) == 1
            for j, columns in enumerate(path.columns_px):
                lit = blurred.at(columns) * (self.shading * path.inside[j])[:, None, None]
                bands = slice(0, self.bands) if shared else slice(j, j + 1)
                yield bands, lit, moments[:, :, bands]
