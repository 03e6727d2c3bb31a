"""Light of the film's orders on every pixel, for a few white lines or for any pattern.

A line lights, through an order, the wavelengths between its two edges: two look-ups in cumulative spectra for
each line and pixel.

Any other pattern is summed over slices of the spectrum. Within a slice the spectrum is taken as linear, so
that its light is the pattern's mean there, and the mean of the pattern times the place in the slice, each
with a weight. Running integrals give both by two look-ups a slice and pixel. Patterns that vary along rows
change too little in a slice for the second; those that vary both ways are taken at the slices' middle rows.
"""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from dsl_core.optics.correspondence import chebyshev_nodes, interpolation_matrix, like
from dsl_core.simulation.rendering.order_tables import OrderTables
from dsl_core.simulation.rendering.pattern_table import SHORT_PX, Edge, PatternTable, between
from dsl_core.simulation.rendering.spectral_tables import NM, Slicing

#: Slices times pixels that are worked out at once: they stay in the cache of a core.
BLOCK = 1 << 16
#: Bands of white columns: start and stop (px), level 0..1.
Runs = list[tuple[float, float, float]]
Floats = NDArray[np.float32]


def white_runs(levels: NDArray[np.uint8]) -> Runs | None:
    """Lit bands of levels `without_repeats` as (start px, stop px, level 0..1); None for other levels."""
    height, _, colours = levels.shape
    if height != 1 or colours != 1:
        return None
    line = levels[0, :, 0].astype(int)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], line, [0]])))
    return [(a - 0.5, b - 0.5, line[a] / 255) for a, b in pairwise(edges) if line[a]]


def by_pixel(signal: Tensor) -> bool:
    """Whether loops over pixels compute it: on the processor."""
    return signal.device.type == "cpu"


def add_bands(signal: Tensor, tables: OrderTables, material_channel: Tensor, bands: Floats) -> None:
    """Add an order's light of bands (n, 3) of white columns to the signal (P,): edges (px), radiance."""
    if not by_pixel(signal):
        for start, stop, radiance in bands.tolist():
            add_band(signal, tables, material_channel, start, stop, radiance)
        return
    from dsl_core.simulation.rendering.kernels import add_order_runs

    add_order_runs(
        signal.numpy(), tables.active.numpy(), _numpy(tables.reach_px), tables.middle_px.numpy(),
        tables.spread_px.numpy(), tables.inverse.numpy(), _numpy(tables.limits_nm), material_channel.numpy(),
        tables.spectra.cumulative.numpy(), bands, float(NM[0]), float(NM.mean()), len(NM),
    )  # fmt: skip


def _numpy(pair: tuple[Tensor, Tensor]) -> tuple[Floats, Floats]:
    return pair[0].numpy(), pair[1].numpy()


def add_band(
    signal: Tensor, tables: OrderTables, material_channel: Tensor, start: float, stop: float, radiance: float
) -> None:
    """Add an order's light of white columns between two edges (px) to the signal (P,)."""
    near = torch.nonzero((tables.reach_px[0] < stop + 2) & (tables.reach_px[1] > start - 2)).ravel()
    if len(near) == 0:
        return
    pixels = tables.active[near]
    table_row = material_channel[pixels] * len(NM)
    coefficients, middle = tables.inverse[:, near], tables.middle_px[near]
    low, high = tables.limits_nm[0][near], tables.limits_nm[1][near]
    scale = 1 / tables.spread_px[near]
    at_edge = []
    for edge in (start, stop):
        x = ((edge - middle) * scale).clip(-1, 1)
        value = coefficients[-1]
        for c in coefficients[:-1].flip(0):
            value = torch.addcmul(c, value, x)
        nm = torch.minimum(torch.maximum(value + float(NM.mean()), low), high) - float(NM[0])
        whole = nm.long()
        entry = tables.spectra.cumulative[table_row + whole]
        at_edge.append(entry[:, 0] + (nm - whole) * entry[:, 1])
    signal.index_add_(0, pixels, (at_edge[1] - at_edge[0]).abs() * radiance)


def order_light(
    tables: OrderTables, table: PatternTable, material_channel: Tensor, slicing: Slicing
) -> Tensor:
    """Light of an order on its active pixels, (A,), of all of the projector's LEDs.

    All slices of a block of pixels are worked out at once: small pictures would otherwise pay for thousands
    of tiny operations, and large ones for memory.
    """
    step = slicing.rows_nm if table.has_rows and not table.along_rows else slicing.nm
    slices = tables.spectra.slices[step]
    lit = []
    for led, of_led in enumerate(table.leds_shown):
        mean, tilt = slices.mean[:, of_led].sum(1), slices.tilt[:, of_led].sum(1)
        strongest = mean.amax(1)
        used = torch.nonzero(strongest >= slicing.floor * strongest.max()).ravel()
        lit.append(_Lit(led, slice(int(used[0]), int(used[-1]) + 1), mean, tilt))
    edges_nm = np.arange(NM[0], NM[-1] + 1, step)
    if by_pixel(tables.middle_px) and (table.along_rows or not table.has_rows):
        return _sliced_by_pixel(tables, table, material_channel[tables.active], edges_nm, lit)
    total = torch.empty_like(tables.middle_px)
    pixels = max(BLOCK // len(edges_nm), 1)
    for start in range(0, len(total), pixels):
        part = slice(start, start + pixels)
        stretches = _Stretches(tables, table, edges_nm, part)
        material = material_channel[tables.active[part]]
        total[part] = sum(stretches.light(*of_led, material) for of_led in lit)
    return total


class _Lit(NamedTuple):
    """An LED of a pattern, the slices in which it has light, and their weights (slices, materials)."""

    led: int
    used: slice
    mean: Tensor
    tilt: Tensor


def _sliced_by_pixel(
    tables: OrderTables, table: PatternTable, material: Tensor, edges_nm: NDArray[np.float64], lit: list[_Lit]
) -> Tensor:
    """`order_light` on the processor, of patterns that vary one way only."""
    from dsl_core.simulation.rendering.kernels import add_order_rows, add_order_slices

    total = torch.zeros_like(tables.middle_px)
    nodes = chebyshev_nodes(NM[0], NM[-1])
    for led, used, mean, tilt in lit:
        edges = edges_nm[used.start : used.stop + 1]
        to_edges = np.ascontiguousarray(interpolation_matrix(nodes, edges).T, np.float32)
        weights, tilts = (w[used].T.contiguous().numpy() for w in (mean, tilt))
        if table.along_rows:
            first = table.integrals[0][led, 0].numpy()
            add_order_rows(
                total.numpy(), to_edges, tables.node_columns.numpy(), tables.node_rows.numpy(), first,
                table.oversample[1], table.width_px, SHORT_PX, material.numpy(), weights,
            )  # fmt: skip
            continue
        first, second = (each[led, 0].numpy() for each in table.integrals if each is not None)
        add_order_slices(
            total.numpy(), to_edges, tables.node_columns.numpy(), (first, second), table.oversample[0],
            edges.astype(np.float32), _numpy(tables.limits_nm), material.numpy(), weights, tilts,
        )  # fmt: skip
    return total


class _Stretches:
    """Where the edges of slices (nm) of a part of an order's pixels are on a pattern."""

    def __init__(
        self, tables: OrderTables, table: PatternTable, edges_nm: NDArray[np.float64], part: slice
    ) -> None:
        nodes = chebyshev_nodes(NM[0], NM[-1])
        to_edges = like(interpolation_matrix(nodes, edges_nm), tables.middle_px)
        self._table = table
        self._columns = to_edges @ tables.node_columns[:, part]
        if table.along_rows:
            self._rows = to_edges @ tables.node_rows[:, part]
        elif table.has_rows:
            centres_nm = 0.5 * (edges_nm[1:] + edges_nm[:-1])
            self._rows = (
                like(interpolation_matrix(nodes, centres_nm), self._columns) @ tables.node_rows[:, part]
            )
        self._limits_nm = tables.limits_nm[0][part], tables.limits_nm[1][part]
        self._edges_nm = like(edges_nm, self._columns)[:, None]

    def light(self, led: int, used: slice, weights: Tensor, tilts: Tensor, material: Tensor) -> Tensor:
        """Light of the slices ``used`` of an LED, (pixels,), with weights and tilts (slices, materials)."""
        mean, place = self._means(led, used)
        total = mean * weights[used].index_select(1, material)
        if place is not None:
            total.addcmul_(place, tilts[used].index_select(1, material))
        low, high = self._limits_nm
        edges = self._edges_nm[used.start : used.stop + 1]
        if not self._table.along_rows and bool((low > edges[0]).any() | (high < edges[-1]).any()):
            # Share of each slice between the limits of each pixel's wavelengths.
            start, stop = (torch.clip(limit, edges[:-1], edges[1:]) for limit in self._limits_nm)
            total *= stop.sub_(start).clip_(min=0).div_(edges[1:] - edges[:-1])
        return total.sum(0)

    def _means(self, led: int, used: slice) -> tuple[Tensor, Tensor | None]:
        """Mean of the pattern in slices, and mean of it times the place in the slice, -1 to 1."""
        table, ends = self._table, self._columns[used.start : used.stop + 1]
        if table.along_rows:
            rows = self._rows[used.start : used.stop + 1]
            # Rows change so little in a slice that it does not matter where in it.
            return table.mean_of_rows(led, rows[:-1], rows[1:]) * table.inside(ends[:-1], ends[1:]), None
        if table.has_rows:
            return table.mean_between(led, ends[:-1], ends[1:], self._rows[used]), None
        edges = table.edge(led, ends)
        return between(Edge(*(at[:-1] for at in edges)), Edge(*(at[1:] for at in edges)))
