"""Light of the film's orders on every pixel, for a few white lines or for any pattern.

A line lights, through an order, the wavelengths between its two edges: two look-ups in cumulative spectra for
each line and pixel.

Any other pattern is summed over slices of the spectrum. Within a slice the spectrum is taken as linear, so
that its light is the pattern's mean there, and the mean of the pattern times the place in the slice, each
with a weight. Running integrals give both by two look-ups a slice and pixel. Patterns that vary along rows
change too little in a slice for the second; those that vary both ways are taken at the slices' middle rows.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from dsl_core.optics.correspondence import chebyshev_nodes, interpolation_matrix, like
from dsl_core.simulation.rendering.order_tables import OrderTables
from dsl_core.simulation.rendering.pattern_table import Edge, PatternTable, between
from dsl_core.simulation.rendering.spectral_tables import NM, Slicing

#: Bands of white columns: start and stop (px), level 0..1.
Runs = list[tuple[float, float, float]]


def white_runs(colour: NDArray[np.uint8]) -> Runs | None:
    """Lit bands of a grey, column-only image as (start px, stop px, level 0..1); None for other images."""
    line = colour[0]
    if not ((line == line[:, :1]).all() and (colour == line).all()):
        return None
    levels = line[:, 0].astype(int)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], levels, [0]])))
    return [(a - 0.5, b - 0.5, levels[a] / 255) for a, b in pairwise(edges) if levels[a]]


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
    tables: OrderTables,
    table: PatternTable,
    led: int,
    of_led: slice,
    material_channel: Tensor,
    slicing: Slicing,
) -> Tensor:
    """Light of an order on its active pixels, (A,), for one of the pattern's LEDs.

    ``of_led`` are the LEDs of the projector that show it.
    """
    step = slicing.rows_nm if table.has_rows and not table.along_rows else slicing.nm
    slices = tables.spectra.slices[step]
    weights, tilts = slices.mean[:, of_led].sum(1), slices.tilt[:, of_led].sum(1)
    material = material_channel[tables.active]
    total = torch.zeros_like(tables.middle_px)
    strongest = weights.amax(1)
    used = torch.nonzero(strongest >= slicing.floor * strongest.max()).ravel().tolist()
    for i, mean, place in _stretches(tables, table, led, step, used):
        total.addcmul_(mean, weights[i][material])
        if place is not None:
            total.addcmul_(place, tilts[i][material])
    return total


def _stretches(
    tables: OrderTables, table: PatternTable, led: int, step: int, used: list[int]
) -> Iterator[tuple[int, Tensor, Tensor | None]]:
    """What slices see of a pattern: its mean, and the mean of it times the place in the slice, -1 to 1."""
    nodes = chebyshev_nodes(NM[0], NM[-1])
    edges_nm = np.arange(NM[0], NM[-1] + 1, step)
    centres_nm = 0.5 * (edges_nm[1:] + edges_nm[:-1])
    to_edges = like(interpolation_matrix(nodes, edges_nm), tables.middle_px)
    to_centres = like(interpolation_matrix(nodes, centres_nm), tables.middle_px)
    low, high = float(tables.limits_nm[0].max()), float(tables.limits_nm[1].min())
    stop: Edge | None = None
    last = -2
    for i in used:
        place: Tensor | None
        if table.along_rows:
            columns = [to_edges[k] @ tables.node_columns for k in (i, i + 1)]
            rows = [to_edges[k] @ tables.node_rows for k in (i, i + 1)]
            # Rows change so little in a slice that it does not matter where in it.
            mean = table.mean_of_rows(led, rows[0], rows[1]) * table.inside(columns[0], columns[1])
            place = None
        elif table.has_rows:
            columns = [to_edges[k] @ tables.node_columns for k in (i, i + 1)]
            row = to_centres[i] @ tables.node_rows
            mean, place = table.mean_between(led, columns[0], columns[1], row), None
        else:
            start = stop if stop is not None and last == i - 1 else None
            start = start or table.edge(led, to_edges[i] @ tables.node_columns)
            stop, last = table.edge(led, to_edges[i + 1] @ tables.node_columns), i
            mean, place = between(start, stop)
        if not table.along_rows and not (low <= edges_nm[i] and edges_nm[i + 1] <= high):
            share = _share_within(tables.limits_nm, float(edges_nm[i]), float(edges_nm[i + 1]))
            mean, place = mean * share, None if place is None else place * share
        yield i, mean, place


def _share_within(limits_nm: tuple[Tensor, Tensor], start_nm: float, stop_nm: float) -> Tensor:
    """Share of a slice between the limits of each pixel's wavelengths, (A,)."""
    low, high = (limit.clip(start_nm, stop_nm) for limit in limits_nm)
    return (high - low).clip(min=0) / (stop_nm - start_nm)
