"""Light on every pixel as loops over pixels, for pictures that are rendered on the processor.

The formulas are those of `first_orders` and `pattern_table`, which serve graphics cards. There, each step of
a formula is an operation over all pixels; here a pixel goes through all steps at once, without memory between
them, and passes what does not reach it. A test holds the two together.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsl_core.solve.compiled import compiled

Floats = NDArray[np.float32]
Doubles = NDArray[np.float64]
Integers = NDArray[np.int64]
#: Widths of the blur beyond which an edge is no longer seen in single precision.
BLURRED = 6.0
#: Columns beyond an order's reach up to which a line's blur counts.
BESIDE_PX = 2.0


@compiled
def add_zero_runs(
    signal: Floats, columns: Floats, runs: Floats, shares: Doubles, zero: Floats, material: Integers,
    blur_px: float, halo_px: float, decay_px: float,
) -> None:  # fmt: skip
    """Add the zero order of white columns to signals (P,).

    ``runs`` (runs, 3) are start, stop (px) and radiance, and of the halo beside each its far edge takes a
    share of ``shares`` (runs,); ``zero`` the signal of every material and colour, ``material`` (P,) which of
    them; ``halo_px`` the light of one side of the halo.
    """
    scale, end = 1 / (math.sqrt(2.0) * blur_px), BLURRED * blur_px
    for p in range(len(columns)):
        total = 0.0
        for r in range(len(runs)):
            near, far = columns[p] - runs[r, 0], columns[p] - runs[r, 1]
            light = 0.0
            if -end < near and far < end:
                rise = 1.0 if near > end else 0.5 * (1 + math.erf(near * scale))
                fall = 0.0 if far < -end else 0.5 * (1 + math.erf(far * scale))
                light = rise - fall
            if halo_px > 0:
                if near < 0:
                    light += halo_px * math.exp(near / decay_px) * (1 - shares[r])
                elif far > 0:
                    light += halo_px * math.exp(-far / decay_px) * (1 - shares[r])
                else:
                    light += halo_px * (2 - math.exp(-near / decay_px) - math.exp(far / decay_px))
            total += runs[r, 2] * light
        signal[p] += total * zero[material[p]]


@compiled
def add_order_runs(
    signal: Floats, active: Integers, reach: tuple[Floats, Floats], middle: Floats, spread: Floats,
    inverse: Floats, limits: tuple[Floats, Floats], material: Integers, cumulative: Floats, runs: Floats,
    first_nm: float, middle_nm: float, count_nm: int,
) -> None:  # fmt: skip
    """Add an order's light of white columns to signals (P,): see `first_orders.add_band`.

    ``runs`` as for `add_zero_runs`; the others are those of `OrderTables` and `SpectralTables`.
    """
    low_px, high_px = reach
    low_nm, high_nm = limits
    top = inverse.shape[0] - 1
    for a in range(len(active)):
        total = 0.0
        for r in range(len(runs)):
            if runs[r, 0] - BESIDE_PX >= high_px[a] or runs[r, 1] + BESIDE_PX <= low_px[a]:
                continue
            row = material[active[a]] * count_nm
            light = 0.0
            for edge in range(2):
                x = min(max((runs[r, edge] - middle[a]) / spread[a], -1.0), 1.0)
                nm = inverse[top, a]
                for k in range(top):
                    nm = inverse[top - 1 - k, a] + x * nm
                place = max(min(max(nm + middle_nm, low_nm[a]), high_nm[a]) - first_nm, 0.0)
                whole = int(place)
                entry = cumulative[row + whole, 0] + (place - whole) * cumulative[row + whole, 1]
                light = entry - light
            total += runs[r, 2] * abs(light)
        if total != 0.0:
            signal[active[a]] += total


@compiled
def add_zero_table(
    signal: Floats, columns: Floats, rows: Floats, blurred: Floats, across: Floats,
    oversample: tuple[int, int], zero: Floats, material: Integers,
) -> None:  # fmt: skip
    """Add the zero order of a pattern that varies one way to signals (P,): see `PatternTable.at`.

    ``blurred`` (samples,) is along columns if ``across`` is empty, else along rows.
    """
    upright = len(across) > 0
    for p in range(len(columns)):
        x = (columns[p] + 0.5) * oversample[0] - 0.5
        if upright:
            light = _at(blurred, (rows[p] + 0.5) * oversample[1] - 0.5) * _at(across, x)
        else:
            light = _at(blurred, x)
        signal[p] += light * zero[material[p]]


@compiled
def _at(table: Floats, position: float) -> Any:
    """Linear interpolation in a table."""
    place = min(max(position, 0.0), len(table) - 1.001)
    whole = int(place)
    return table[whole] + (place - whole) * (table[whole + 1] - table[whole])


@compiled
def add_order_slices(
    total: Floats, to_edges: Floats, node_columns: Floats, integrals: tuple[Floats, Floats], kept: int,
    edges_nm: Floats, limits: tuple[Floats, Floats], material: Integers, weights: Floats, tilts: Floats,
) -> None:  # fmt: skip
    """Add an order's light of a pattern along columns to its active pixels' (A,): see `order_light`.

    ``to_edges`` (nodes, edges) interpolates ``node_columns`` (nodes, A) to the ``edges_nm`` of the slices in
    use; ``integrals`` (samples + 1,) are the pattern's and that one's own, with ``kept`` samples a column;
    ``weights`` and ``tilts`` are (materials, slices), ``material`` (A,).
    """
    first, second = integrals
    low_nm, high_nm = limits
    nodes, edges = to_edges.shape
    last, step, end = np.float32(len(first) - 1), np.float32(1.0 / kept), np.float32(len(first) - 1.001)
    zero, half, wide = np.float32(0), np.float32(0.5), np.float32(kept)
    at, one, own = np.empty(edges, np.float32), np.empty(edges, np.float32), np.empty(edges, np.float32)
    for a in range(len(total)):
        at[:] = half
        for n in range(nodes):
            node = node_columns[n, a]
            for e in range(edges):
                at[e] += to_edges[n, e] * node
        for e in range(edges):
            samples = at[e] * wide
            place = min(max(samples, zero), end)
            whole = np.uint32(np.int32(place))
            part = place - np.float32(np.int32(place))
            reached = first[whole] + part * (first[whole + np.uint32(1)] - first[whole])
            beyond = max(samples - last, zero) * step
            one[e] = reached
            own[e] = second[whole] + part * (second[whole + np.uint32(1)] - second[whole]) + beyond * reached
        m, low, high = material[a], low_nm[a], high_nm[a]
        for s in range(edges - 1):
            inverse = np.float32(1) / (at[s + 1] - at[s])
            mean = (one[s + 1] - one[s]) * inverse
            place = ((one[s + 1] + one[s]) - np.float32(2) * (own[s + 1] - own[s]) * inverse) * inverse
            at[s] = mean * weights[m, s] + place * tilts[m, s]
        if low > edges_nm[0] or high < edges_nm[edges - 1]:
            for s in range(edges - 1):
                start, stop = edges_nm[s], edges_nm[s + 1]
                at[s] *= max(min(high, stop) - max(low, start), zero) / (stop - start)
        light = zero
        for s in range(edges - 1):
            light += at[s]
        total[a] += light


@compiled
def add_order_rows(
    total: Floats, to_edges: Floats, node_columns: Floats, node_rows: Floats, first: Floats, kept: int,
    width_px: int, shortest_px: float, material: Integers, weights: Floats,
) -> None:  # fmt: skip
    """Add an order's light of a pattern along rows to its active pixels' (A,): see `order_light`.

    Arguments as for `add_order_slices`; ``first`` is the pattern's integral along rows, and stretches are
    taken as no shorter than ``shortest_px``.
    """
    nodes, edges = to_edges.shape
    zero, half, wide, kept_ = np.float32(0), np.float32(0.5), np.float32(width_px), np.float32(kept)
    end, shortest = np.float32(len(first) - 1.001), np.float32(0.5 * shortest_px)
    x, y = np.empty(edges, np.float32), np.empty(edges, np.float32)
    for a in range(len(total)):
        x[:] = half
        y[:] = half
        for n in range(nodes):
            column, row = node_columns[n, a], node_rows[n, a]
            for e in range(edges):
                x[e] += to_edges[n, e] * column
                y[e] += to_edges[n, e] * row
        m = material[a]
        for s in range(edges - 1):
            middle, apart = half * (y[s] + y[s + 1]), max(half * abs(y[s + 1] - y[s]), shortest)
            place = min(max((middle + apart) * kept_, zero), end)
            whole = np.uint32(np.int32(place))
            part = place - np.float32(np.int32(place))
            above = first[whole] + part * (first[whole + np.uint32(1)] - first[whole])
            place = min(max((middle - apart) * kept_, zero), end)
            whole = np.uint32(np.int32(place))
            part = place - np.float32(np.int32(place))
            below = first[whole] + part * (first[whole + np.uint32(1)] - first[whole])
            inside = min(max(x[s + 1], zero), wide) - min(max(x[s], zero), wide)
            y[s] = (above - below) * inside * weights[m, s] / (np.float32(2) * apart * (x[s + 1] - x[s]))
        light = zero
        for s in range(edges - 1):
            light += y[s]
        total[a] += light
