"""A pattern as light at any projector position: blurred, with halo, oversampled, and its running integral."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from dsl_core.model.rig import ProjectorResponse
from dsl_core.optics.light_path import zero_order_profile


@dataclass(frozen=True)
class PatternTable:
    """Samples ``OVERSAMPLE`` a pixel; rows are kept only when the pattern has any structure along them."""

    blurred: Tensor  # (LEDs, rows, samples), zero order: blur and halo
    running: Tensor  # (LEDs, rows, samples + 1), first orders: integral of the blur along columns, px
    oversample: tuple[int, int]

    @classmethod
    def of(
        cls, radiance: NDArray[np.float64], response: ProjectorResponse, device: torch.device
    ) -> PatternTable:
        """Make the table of a radiance image, shape (height, width, LEDs)."""
        flat = bool((radiance == radiance[:1]).all())
        source = torch.as_tensor(
            np.moveaxis(radiance[:1] if flat else radiance, 2, 0), device=device, dtype=torch.float32
        )
        kx, ky = (8, 1) if flat else (4, 4)
        across = _spread(radiance.shape[1], kx, response, True).to(device)
        blurred = source @ across.T
        if not flat:
            down = _spread(radiance.shape[0], ky, response, False).to(device)
            blurred = down @ blurred
            source = source.repeat_interleave(ky, 1)
        sharp = _spread(radiance.shape[1], kx, response, False).to(device)
        running = torch.nn.functional.pad((source @ sharp.T / kx).cumsum(2), (1, 0))
        return cls(blurred.contiguous(), running.contiguous(), (kx, ky))

    @property
    def leds(self) -> int:
        """1 for grey patterns, else 3."""
        return len(self.blurred)

    @property
    def has_rows(self) -> bool:
        """Whether the pattern varies along rows."""
        return self.blurred.shape[1] > 1

    def at(self, led: int, column: Tensor, row: Tensor) -> Tensor:
        """Zero-order light at projector positions (px), linear between samples."""
        blurred, across = self.blurred[led], (column + 0.5) * self.oversample[0] - 0.5
        if not self.has_rows:
            return _lookup(blurred, across, None)
        down = ((row + 0.5) * self.oversample[1] - 0.5).clip(0, blurred.shape[0] - 1.001)
        above = down.int()
        offset = above * blurred.shape[1]
        upper = _lookup(blurred, across, offset)
        return torch.lerp(upper, _lookup(blurred, across, offset + blurred.shape[1]), down - above)

    def mean_between(self, led: int, start: Tensor, stop: Tensor, row: Tensor | None) -> Tensor:
        """Mean of the pattern between two columns (px), zero outside the frame."""
        running = self.running[led]
        offset = self._offset(row, running)
        across = self.oversample[0]
        above, below = (_lookup(running, (column + 0.5) * across, offset) for column in (stop, start))
        return (above - below) / (stop - start)

    def _offset(self, row: Tensor | None, table: Tensor) -> Tensor | None:
        """Index of the first sample of the row nearest to positions (px); None for patterns without rows."""
        if row is None or not self.has_rows:
            return None
        nearest = ((row + 0.5) * self.oversample[1]).clip(0, table.shape[0] - 1).int()
        return nearest.mul_(table.shape[1])


def _lookup(table: Tensor, position: Tensor, offset: Tensor | None) -> Tensor:
    """Linear interpolation in a table (rows, samples), the row given by the offset of its first sample."""
    p = position.clip(0, table.shape[1] - 1.001)
    index = p.int()
    p -= index
    if offset is not None:
        index += offset
    flat = table.reshape(-1)
    return torch.lerp(flat.index_select(0, index), flat.index_select(0, index + 1), p)


@lru_cache(maxsize=12)
def _spread(pixels: int, oversample: int, response: ProjectorResponse, halo: bool) -> Tensor:
    """Matrix from pixel radiances to blurred samples, shape (pixels * oversample, pixels)."""
    if not halo:
        response = response.model_copy(update={"halo_peak_per_px": 0.0})
    at = (torch.arange(pixels * oversample, dtype=torch.float64)[:, None] + 0.5) / oversample - 0.5
    pixel = torch.arange(pixels, dtype=torch.float64)
    return zero_order_profile(at - pixel, -0.5, 0.5, response).float()
