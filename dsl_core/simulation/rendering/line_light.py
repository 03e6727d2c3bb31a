"""First-order light of a few white lines, from cumulative spectra: two look-ups a line and pixel.

A line lights, through an order, the wavelengths between its two edges.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from dsl_core.simulation.rendering.order_tables import OrderTables
from dsl_core.simulation.rendering.spectral_tables import NM

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
