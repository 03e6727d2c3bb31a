"""A pattern as light at any projector position: blurred, with halo, oversampled, and its running integral."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from dsl_core.model.rig import ProjectorResponse
from dsl_core.optics.lines.profile import zero_order_profile

#: Samples a pixel along the way that a pattern varies, and both ways where it varies both.
FINE, COARSE = 8, 4
#: Single precision tells the ends of longer stretches apart, and blur is wider.
SHORT_PX = 0.1


class Edge(NamedTuple):
    """An end of a stretch of a pattern: positions (px), the pattern's integral there, and that one's own."""

    at: Tensor
    first: Tensor
    second: Tensor


@dataclass(frozen=True)
class PatternTable:
    """A pattern of which samples are kept, ``oversample`` a pixel across and down.

    ``blurred`` (LEDs, rows, samples) is what the zero order brings, with blur and halo; its rows are kept
    only when the pattern has any structure along them. Where it varies along rows only, it is (LEDs, 1,
    samples) along them, and has the factor ``across`` (samples) along columns, which differs from 1 near the
    sides of the frame. First orders have no halo. ``integrals`` are the integral (px) of what they bring,
    (LEDs, rows, samples + 1) along columns, or (LEDs, 1, samples + 1) where the pattern varies along rows
    only; and, where it varies along columns only, that integral's own (px^2).
    """

    blurred: Tensor
    across: Tensor | None
    integrals: tuple[Tensor, Tensor | None]
    oversample: tuple[int, int]
    width_px: int

    @classmethod
    def of_strip(
        cls,
        levels: NDArray[np.uint8],
        size: tuple[int, ...],
        response: ProjectorResponse,
        device: torch.device,
    ) -> PatternTable:
        """Table of drive levels `without_repeats`, (rows, columns, 3), for an image of size (height, width).

        Tables of patterns that vary one way only are kept.
        """
        if 1 not in levels.shape[:2]:
            return cls.of(_radiance(levels, response), response, device)
        return _of_strip(levels.tobytes(), levels.shape, (size[0], size[1]), response, device)

    @classmethod
    def of(
        cls, radiance: NDArray[np.float64], response: ProjectorResponse, device: torch.device
    ) -> PatternTable:
        """Make the table of a radiance image, shape (height, width, LEDs)."""
        flat = bool((radiance == radiance[:1]).all())
        upright = not flat and bool((radiance == radiance[:, :1]).all())
        strip = radiance[:1] if flat else radiance[:, :1] if upright else radiance
        return cls._of(strip, radiance.shape[:2], response, device)

    @classmethod
    def _of(
        cls,
        strip: NDArray[np.float64],
        size: tuple[int, ...],
        response: ProjectorResponse,
        device: torch.device,
    ) -> PatternTable:
        """Table of radiances, one row or column of which is given if they repeat over the size."""
        flat, upright = len(strip) == 1, len(strip) > 1 and strip.shape[1] == 1
        height, width = size
        kx, ky = (FINE, 1) if flat else (COARSE, FINE if upright else COARSE)
        source = torch.from_numpy(np.moveaxis(strip, 2, 0).astype(np.float32)).to(device)
        sides = _spread(width, kx, response, True).to(device)
        pixels, kept = (height, ky) if upright else (width, kx)
        fine, step = _spread(pixels, kept, response, False).to(device), 1 / kept
        sharp = (source.mT if upright else source) @ fine.T
        first = torch.nn.functional.pad((sharp * step).cumsum(2), (1, 0))
        if upright:
            # Blur along columns only matters at the sides: the table of both ways is a product.
            return cls(sharp.contiguous(), sides.sum(1), (first.contiguous(), None), (kx, ky), width)
        blurred, second = source @ sides.T, None
        if flat:
            # By trapezoids, summed in double precision: stretches are short, the sums long.
            middle = 0.5 * (first[..., 1:] + first[..., :-1]).double() * step
            second = torch.nn.functional.pad(middle.cumsum(2), (1, 0)).float()
        else:
            blurred = _spread(height, ky, response, False).to(device) @ blurred
            first = first.repeat_interleave(ky, 1)
        return cls(blurred.contiguous(), None, (first.contiguous(), second), (kx, ky), width)

    @property
    def leds(self) -> int:
        """1 for grey patterns, else 3."""
        return len(self.blurred)

    @property
    def leds_shown(self) -> tuple[slice, ...]:
        """The projector's LEDs that show each of the pattern's."""
        return (slice(0, 3),) if self.leds == 1 else tuple(slice(i, i + 1) for i in range(3))

    @property
    def along_rows(self) -> bool:
        """Whether the pattern varies along rows only."""
        return self.across is not None

    @property
    def has_rows(self) -> bool:
        """Whether the pattern varies along rows."""
        return self.along_rows or self.blurred.shape[1] > 1

    def at(self, led: int, column: Tensor, row: Tensor) -> Tensor:
        """Zero-order light at projector positions (px), linear between samples."""
        blurred, across = self.blurred[led], (column + 0.5) * self.oversample[0] - 0.5
        if not self.has_rows:
            return _lookup(blurred, across, None)
        down = (row + 0.5) * self.oversample[1] - 0.5
        if self.across is not None:
            return _lookup(blurred, down, None) * _lookup(self.across[None], across, None)
        down = down.clip(0, blurred.shape[0] - 1.001)
        above = down.int()
        offset = above * blurred.shape[1]
        upper = _lookup(blurred, across, offset)
        return torch.lerp(upper, _lookup(blurred, across, offset + blurred.shape[1]), down - above)

    def edge(self, led: int, at: Tensor) -> Edge:
        """The integrals at columns (px); for patterns that vary along columns only."""
        first, second = self.integrals
        assert second is not None
        kept = self.oversample[0]
        samples = (at + 0.5) * kept
        reached, own = _lookups((first[led], second[led]), samples)
        # Beyond the frame there is no light: the integral is constant, and its own integral still rises.
        beyond = samples.sub_(first.shape[2] - 1).clip_(min=0).mul_(1 / kept)
        return Edge(at, reached, own.add_(beyond.mul_(reached)))

    def mean_of_rows(self, led: int, start: Tensor, stop: Tensor) -> Tensor:
        """Mean along rows (px), zero outside the frame; for patterns that vary along rows only."""
        middle, half = 0.5 * (start + stop), (0.5 * (stop - start)).abs().clip(min=0.5 * SHORT_PX)
        first, kept = self.integrals[0][led], self.oversample[1]
        above, below = (_lookup(first, (at + 0.5) * kept, None) for at in (middle + half, middle - half))
        return (above - below) / (2 * half)

    def mean_between(self, led: int, start: Tensor, stop: Tensor, row: Tensor) -> Tensor:
        """Mean along columns (px) at the nearest row, zero outside; for patterns that vary both ways."""
        first = self.integrals[0][led]
        offset = self._offset(row, first)
        across = self.oversample[0]
        above, below = (_lookup(first, (column + 0.5) * across, offset) for column in (stop, start))
        return (above - below) / (stop - start)

    def inside(self, start: Tensor, stop: Tensor) -> Tensor:
        """Share of stretches between columns (px) that is inside the frame."""
        above, below = ((column + 0.5).clip(0, self.width_px) for column in (stop, start))
        return (above - below) / (stop - start)

    def _offset(self, row: Tensor, table: Tensor) -> Tensor:
        """Index of the first sample of the row nearest to positions (px)."""
        nearest = ((row + 0.5) * self.oversample[1]).clip(0, table.shape[0] - 1).int()
        return nearest.mul_(table.shape[1])


def without_repeats(levels: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Drive levels (height, width, 3) once for all rows or columns, and colours, if they are alike there."""
    if levels.strides[2] == 0:
        levels = levels[..., :1]
    height, _, colours = levels.shape
    # Rows of bytes are compared many at once, pixels of three bytes one by one.
    rows = levels.reshape(height, -1)
    if (rows[1:] == rows[:-1]).all():
        levels = levels[:1]
    elif (rows[:, colours:] == rows[:, :-colours]).all():
        levels = levels[:, :1]
    if colours == 1:
        return levels
    red, green, blue = np.moveaxis(levels, 2, 0)
    return levels[..., :1] if (red == green).all() and (red == blue).all() else levels


def between(start: Edge, stop: Edge) -> tuple[Tensor, Tensor]:
    """Mean of a pattern between two edges, and the mean of pattern times place, from -1 at the start to 1."""
    length = stop.at - start.at
    mean = (stop.first - start.first) / length
    place = (stop.first + start.first) / length - 2 * (stop.second - start.second) / (length * length)
    return mean, place


def _lookup(table: Tensor, position: Tensor, offset: Tensor | None) -> Tensor:
    """Linear interpolation in a table (rows, samples), the row given by the offset of its first sample."""
    return _lookups((table,), position, offset)[0]


def _lookups(tables: tuple[Tensor, ...], position: Tensor, offset: Tensor | None = None) -> list[Tensor]:
    """`_lookup` in tables of the same shape."""
    p = position.clip(0, tables[0].shape[1] - 1.001)
    index = p.int()
    p -= index
    if offset is not None:
        index += offset
    index, after, p = index.reshape(-1), (index + 1).reshape(-1), p.reshape(-1)
    flat = (table.reshape(-1) for table in tables)
    ends = ((table.index_select(0, index), table.index_select(0, after)) for table in flat)
    return [torch.lerp(low, high, p).reshape(position.shape) for low, high in ends]


def _radiance(levels: NDArray[np.uint8], response: ProjectorResponse) -> NDArray[np.float64]:
    """Light of drive levels beyond that of a dark projector, same shape."""
    return np.asarray(response.radiance(np.arange(256) / 255)[levels] - response.black_fraction)


@lru_cache(maxsize=64)
def _of_strip(
    levels: bytes,
    shape: tuple[int, ...],
    size: tuple[int, int],
    response: ProjectorResponse,
    device: torch.device,
) -> PatternTable:
    """Table of one row or column of levels that is repeated over the frame (height, width).

    Calibrations show the same codes at every pose and position.
    """
    strip = _radiance(np.frombuffer(levels, np.uint8).reshape(shape), response)
    return PatternTable._of(strip, size, response, device)


@lru_cache(maxsize=12)
def _spread(pixels: int, oversample: int, response: ProjectorResponse, halo: bool) -> Tensor:
    """Matrix from pixel radiances to blurred samples, shape (pixels * oversample, pixels)."""
    if not halo:
        response = response.model_copy(update={"halo_peak_per_px": 0.0})
    # Only the distance between sample and pixel counts: one profile, shifted from column to column.
    apart = torch.arange(-oversample * (pixels - 1), oversample * pixels, dtype=torch.float64)
    profile = zero_order_profile((apart + 0.5) / oversample - 0.5, -0.5, 0.5, response).float().numpy()
    (size,) = profile.strides
    shifted = np.lib.stride_tricks.as_strided(
        profile[oversample * (pixels - 1) :], (pixels * oversample, pixels), (size, -oversample * size)
    )
    return torch.from_numpy(shifted.copy())
