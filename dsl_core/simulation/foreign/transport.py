"""Light transport: what every column (or row) of the projector, lit alone, brings to every part of a picture.

The light of each wavelength is dropped on a fine grid of projector positions, the grid is spread by the
sampled line spread, and what falls on each column is added up. A picture of a pattern that varies along
columns only, or rows only, is then one product.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from dsl_core.model.rig import ProjectorResponse
from dsl_core.simulation.foreign.light_sources import FINE_NM, Sources
from dsl_core.simulation.foreign.spread import FINE, Spread

Floats = NDArray[np.float64]
Axis = Literal["columns", "rows"]
#: Parts worked on at once: their grids fit into memory that the processor reaches fast.
CHUNK = 1024


@dataclass(frozen=True)
class Brought:
    """Light of one order at the sampled wavelengths: what each kind of part gets, and which kind it is.

    ``light`` (kinds, wavelengths), DN per ms at unit shading, integrated over the sampling step;
    ``kind`` (parts,). ``filter_curve`` are wavelengths and transmissions of a filter, whose centre differs
    from part to part by ``centre_ratio`` (parts,).
    """

    light: Tensor
    kind: Tensor
    filter_curve: tuple[Floats, Floats] | None
    centre_ratio: Tensor

    def of(self, parts: Tensor, wavelengths_nm: Floats) -> Tensor:
        """Light of parts, (parts, wavelengths)."""
        found = self.light[self.kind[parts]]
        if self.filter_curve is None:
            return found
        nm = wavelengths_nm[None] / self.centre_ratio[parts].double().cpu().numpy()[:, None]
        passed = np.interp(nm, *self.filter_curve, left=0.0, right=0.0)
        return found * torch.as_tensor(passed, dtype=found.dtype, device=found.device)


@dataclass(frozen=True)
class Frame:
    """The projector's frame and how its light spreads; with ``film`` there is a halo of the zero order."""

    size_px: tuple[int, int]
    response: ProjectorResponse
    spread: Spread
    film: bool

    def lines(self, axis: Axis) -> int:
        """Columns or rows."""
        return self.size_px[axis == "rows"]

    def halo(self, distance_px: Tensor) -> Tensor:
        """Halo of a lit column at distances (px)."""
        if not self.film or self.response.halo_peak_per_px == 0:
            return torch.zeros_like(distance_px)
        # Mean of the law over the column: five places in it.
        total = torch.zeros_like(distance_px)
        for place in (-0.4, -0.2, 0.0, 0.2, 0.4):
            total += torch.exp((distance_px + place).abs() * (-1 / self.response.halo_decay_px))
        return total * (self.response.halo_peak_per_px / 5)

    def add(
        self, table: Tensor, axis: Axis, sources: Sources, brought: Brought, wavelengths_nm: Floats
    ) -> None:
        """Add an order's light of every line to a table (parts, lines)."""
        other = self.lines("rows" if axis == "columns" else "columns")
        for start in range(0, len(sources.active), CHUNK):
            some = sources.part(slice(start, start + CHUNK))
            columns, rows = (q.T.float() for q in some.at(wavelengths_nm))
            light = brought.of(some.active, wavelengths_nm)
            along, across = (columns, rows) if axis == "columns" else (rows, columns)
            if some.order == 0 and axis == "rows":
                # Of a lit row all columns are lit, and each has its halo.
                light = light * self._lit_columns(across[:, :1])
            else:
                light = light * self._within(across, other)
            reached = self._spread(along, across, light, axis)
            if some.order == 0 and axis == "columns":
                at = torch.arange(self.lines(axis), device=light.device)
                reached += light.sum(1, keepdim=True) * self.halo(along[:, :1] - at)
            table[some.active] += reached

    def _lit_columns(self, column_px: Tensor) -> Tensor:
        """Zero-order light at columns (px) when all columns are lit, (n, 1)."""
        at = torch.arange(self.size_px[0], device=column_px.device)
        return self._within(column_px, self.size_px[0]) + self.halo(column_px - at).sum(1, keepdim=True)

    def _within(self, place_px: Tensor, lines: int) -> Tensor:
        """Light at places (px) of a frame all of whose ``lines`` are lit: 1 inside, spread at its two ends.

        White, columns and rows so fall off alike there, and a pattern and its inverse add up to white.
        """
        found = ((place_px > -0.5) & (place_px < lines - 0.5)).to(place_px.dtype)
        reach_px = self.spread.reach / FINE + 1
        near = (place_px.abs() < reach_px) | ((place_px - lines).abs() < reach_px)
        x = place_px[near].double().cpu().numpy()
        edge = np.cumsum(self.spread.point())
        places = (np.arange(len(edge)) + 0.5 - self.spread.reach) / FINE
        passed = [np.interp(x - at_px, places, edge) for at_px in (-0.5, lines - 0.5)]
        found[near] = torch.as_tensor(passed[0] - passed[1], dtype=found.dtype, device=found.device)
        return found

    def _spread(self, along: Tensor, across: Tensor, light: Tensor, axis: Axis) -> Tensor:
        """Light of each line (parts, lines) from light at positions (px), all (parts, wavelengths)."""
        lines, reach = self.lines(axis), self.spread.reach // FINE
        # Light from beyond every line's reach falls on none, however far off a steep film says it comes from.
        along = along.clip(-reach - 2, lines + reach + 1)
        # Each part has a grid of its own lines: those that its wavelengths come from, and the reach.
        first = along.amin(1).floor() - reach
        own = int((along.amax(1) - first).max()) + reach + 2
        place = (along - first[:, None] + reach) * FINE
        below = place.floor()
        index = below.long()
        upper = light * (place - below)
        grid = torch.zeros((len(light), (own + 2 * reach) * FINE), device=light.device)
        grid.scatter_add_(1, index, light - upper)
        grid.scatter_add_(1, index + 1, upper)
        widths = self.spread.widths
        if len(widths) == 1:
            found = self._collected(grid, own, 1.0)
        else:
            here = self._widths_of(first, grid.shape[1], across, axis)
            step = widths[1] - widths[0]
            found = torch.zeros((len(light), own), device=light.device)
            narrowest, widest = float(here.amin()), float(here.amax())
            for width in widths:
                if narrowest - step < width < widest + step:
                    share = (1 - (here - width).abs_().div_(step)).clip_(min=0)
                    found += self._collected(share.mul_(grid), own, width)
        # A line beyond the frame on each side takes what is not there.
        at = (first.long()[:, None] + torch.arange(own, device=light.device)).clip(-1, lines) + 1
        return torch.zeros((len(light), lines + 2), device=light.device).scatter_add_(1, at, found)[:, 1:-1]

    def _widths_of(self, first: Tensor, cells: int, across: Tensor, axis: Axis) -> Tensor:
        """Relative width of the spread at every cell of a grid, (parts, cells)."""
        at = first[:, None].cpu().numpy() + (np.arange(cells, dtype=np.float32) - self.spread.reach) / FINE
        middle = across.median(1).values.cpu().numpy()[:, None]
        columns, rows = (at, middle) if axis == "columns" else (middle, at)
        width = self.spread.width_at(columns, rows, self.size_px)
        return torch.as_tensor(width, dtype=torch.float32, device=first.device)

    def _collected(self, grid: Tensor, lines: int, width: float) -> Tensor:
        """What falls on each line of a grid (parts, cells), spread by a width, (parts, lines).

        Light at a place comes from a line by the distance from the line to the place: cell ``k FINE + t`` is
        ``t - reach`` samples from the middle of line k.
        """
        weights = self.spread.pixel(width)
        window = np.pad(weights, (0, -len(weights) % FINE)).reshape(-1, FINE)
        pieces = torch.as_tensor(window, dtype=torch.float32, device=grid.device)
        # The last piece holds the window's last sample, in cells beyond those that hold light.
        blocks = torch.nn.functional.pad(grid, (0, FINE)).reshape(len(grid), -1, FINE)
        # Lines last, so that what is added up lies side by side in memory.
        products = pieces @ blocks.mT
        total = torch.zeros((len(grid), lines), device=grid.device)
        for k in range(len(pieces)):
            total += products[:, k, k : k + lines]
        return total


def sampled(nm_light: Floats) -> Tensor:
    """Densities (..., wavelengths) times the sampling step, ends counted half."""
    weight = np.full(len(FINE_NM), FINE_NM[1] - FINE_NM[0])
    weight[[0, -1]] *= 0.5
    return torch.as_tensor(nm_light * weight, dtype=torch.float32)
