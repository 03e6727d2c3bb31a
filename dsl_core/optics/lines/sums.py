"""Normal equations of single scan lines, one sample after the other, from the frames: a loop to be compiled.

It adds up what `dsl_core.optics.lines.equations` explains and does with tensors, which remain for a GPU; a
test holds both together. Columns are whole numbers of the profile table's steps, so that a line of a band is
found in it without rounding.
"""

from __future__ import annotations

from typing import Any

import numpy as np

Array = Any


def add_samples(
    radiance: Array, halves: Array, singles: Array, variances: Array, corner: tuple[int, int], index: Array,
    own_rows: tuple[int, int], columns: Array, inside: Array, tables: Array, supports: Array, lit: Array,
    first: int, step: int, white: Array, colour: Array, offset: Array, offset_variance: Array,
    amplitude: Array, halo_line: Array, halos: Array, halo_ratio: Array, model_error: float, surplus: float,
    size: int, with_offsets: bool, equations: Array,
) -> None:  # fmt: skip
    """Equations (rows, channels, columns) of the samples in some rows of a grid.

    Channels are the matrix (bands x ``size``), the right side, the square and the number of the data, and
    with ``with_offsets`` the variance that an offset gives the right side. ``index`` (rows, columns) of the
    grid, whose first pixel is ``corner`` of the picture, is a sample's place in the lists, negative where
    there is none. ``own_rows`` are the rows of the grid to fill, from the first of ``equations`` on.

    ``radiance`` (frames, rows, columns) comes with deviations in ``halves``, whose bits stand for
    ``variances``, or in ``singles``; the other one is empty. ``columns`` and ``supports`` are in steps of the
    ``tables``, as ``first`` and ``step`` of the lines are; ``columns`` and ``inside`` are (orders, bands,
    samples), ``white`` (orders, 3, bands), ``lit`` (orders, 2) frames of each order. ``halo_line`` is the
    last line not beyond a sample's column, ``halos`` (2, samples) that line's halo and the next one's,
    ``halo_ratio`` how it falls from line to line. ``surplus`` is added to the main diagonal, relative to it.
    """
    bands = columns.shape[1]
    at_right, at_square = bands * size, bands * size + bands
    channels = equations.shape[1]
    frames = radiance.shape[0]
    sums, value, weight = np.zeros(channels), np.zeros(frames), np.zeros(frames)
    own, base = np.zeros(frames), np.zeros(bands, np.int64)
    low, high = np.zeros(bands, np.int64), np.zeros(bands, np.int64)
    for row in range(own_rows[0], own_rows[1]):
        y, to = corner[0] + row, row - own_rows[0]
        for column in range(index.shape[1]):
            s, x = index[row, column], corner[1] + column
            if s < 0:
                for c in range(channels):
                    equations[to, c, column] = 0.0
                continue
            for c in range(channels):
                sums[c] = 0.0
            for m in range(columns.shape[0]):
                support = supports[m]
                begin, end = bands, -1
                least, most = 0, 0
                for j in range(bands):
                    if inside[m, j, s]:
                        at = columns[m, j, s] - first
                        least, most = (at, at) if end < 0 else (min(least, at), max(most, at))
                        begin, end = min(begin, j), j
                        base[j] = at + support
                        low[j] = max((at - support) // step + 1, lit[m, 0])
                        high[j] = min((at + support - 1) // step, lit[m, 1] - 1)
                if end < 0:
                    continue
                before = halo_line[s]
                start = max((least - support) // step + 1, lit[m, 0])
                stop = min((most + support - 1) // step, lit[m, 1] - 1) + 1
                for k in range(start, stop):
                    if k <= before:
                        halo = halos[0, s] * halo_ratio[before - k]
                    else:
                        halo = halos[1, s] * halo_ratio[k - before - 1]
                    signal = radiance[k, y, x] - offset[s] - amplitude[s] * halo
                    if halves.size:
                        noise = np.float64(variances[halves[k, y, x]])
                    else:
                        noise = np.float64(singles[k, y, x]) * singles[k, y, x]
                    heavy = 1.0 / (noise + (model_error * signal) ** 2)
                    # Infinite deviations have no weight by themselves; what is no number must not survive.
                    if not (heavy < np.inf and abs(signal) < np.inf):
                        heavy, signal = 0.0, 0.0
                    value[k], weight[k] = signal, heavy
                    sums[at_square] += heavy * signal * signal
                    sums[at_square + 1] += 1.0 if heavy > 0.0 else 0.0
                for j in range(begin, end + 1):
                    if not inside[m, j, s]:
                        continue
                    bright, right, grey = white[m, colour[s], j], 0.0, 0.0
                    for k in range(low[j], high[j] + 1):
                        own[k] = weight[k] * tables[m, base[j] - k * step]
                        right += own[k] * value[k]
                        grey += own[k]
                    sums[at_right + j] += bright * right
                    if with_offsets:
                        sums[at_square + 2 + j] += bright * grey
                    for o in range(min(size, end + 1 - j)):
                        if inside[m, j + o, s]:
                            both, of = 0.0, base[j + o]
                            for k in range(max(low[j], low[j + o]), min(high[j], high[j + o]) + 1):
                                both += own[k] * tables[m, of - k * step]
                            sums[j * size + o] += bright * white[m, colour[s], j + o] * both
            for j in range(bands):
                sums[j * size] *= 1.0 + surplus
                if with_offsets:
                    sums[at_square + 2 + j] *= sums[at_square + 2 + j] * offset_variance[s]
            for c in range(channels):
                equations[to, c, column] = sums[c]
