"""Normal equations of single scan lines, one sample after the other, from the frames: a loop to be compiled.

It adds up what `dsl_core.optics.lines.equations` explains and does with tensors, which remain for a GPU; a
test holds both together. Columns are whole numbers of the profile table's steps, so that a line of a band is
found in it without rounding.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = Any
#: Bits of a number of frames: cut to these it is not negative, and need not count from an array's end.
MOST = (1 << 32) - 1


def by_line(table: NDArray[np.floating], step: int) -> NDArray[np.float64]:
    """A profile's ``table`` so that what one line after the other sees of it is side by side, (step, lines).

    Lines are ``step`` entries of the table apart. The last one of a row sees the table's first entries.
    """
    lines = -(-len(table) // step)
    padded = np.zeros(lines * step)
    padded[: len(table)] = table
    return np.ascontiguousarray(padded.reshape(lines, step)[::-1].T)


def add_samples(
    radiance: Array, halves: Array, singles: Array, variances: Array, corner: tuple[int, int], index: Array,
    own_rows: tuple[int, int], columns: Array, inside: Array, tables: Array, supports: Array, lit: Array,
    first: int, step: int, white: Array, colour: Array, offset: Array, offset_variance: Array,
    amplitude: Array, halo_line: Array, halos: Array, halo_ratio: Array, model_error: float, surplus: float,
    size: int, with_offsets: bool, equations: Array,
) -> None:  # fmt: skip
    """Equations (rows, columns, channels) of the samples in some rows of a grid.

    Channels are the matrix (bands x ``size``), the right side, the square and the number of the data, and
    with ``with_offsets`` the variance that an offset gives the right side. ``index`` (rows, columns) of the
    grid, whose first pixel is ``corner`` of the picture, is a sample's place in the lists, negative where
    there is none. ``own_rows`` are the rows of the grid to fill, from the first of ``equations`` on.

    ``radiance`` (frames, rows, columns) comes with deviations in ``halves``, whose bits stand for
    ``variances``, or in ``singles``; the other one is empty. ``tables`` (orders, step, lines) are as from
    `by_line`. ``columns`` and ``supports`` are in steps of the profile's table, as ``first`` and ``step`` of
    the lines are; ``columns`` and ``inside`` are (orders, bands, samples), ``white`` (orders, 3, bands),
    ``lit`` (orders, 2) frames of each order. ``halo_line`` is the
    last line not beyond a sample's column, ``halos`` (2, samples) that line's halo and the next one's,
    ``halo_ratio`` how it falls from line to line. ``surplus`` is added to the main diagonal, relative to it.
    """
    bands = columns.shape[1]
    at_right, at_square = bands * size, bands * size + bands
    channels = equations.shape[2]
    frames = radiance.shape[0]
    sums, value, weight = np.zeros(channels), np.zeros(frames), np.zeros(frames)
    own, last = np.zeros(frames), tables.shape[2] - 1
    phase, place, bright = np.zeros(bands, np.int64), np.zeros(bands, np.int64), np.zeros(bands)
    low, high = np.zeros(bands, np.int64), np.zeros(bands, np.int64)
    for row in range(own_rows[0], own_rows[1]):
        y, to = corner[0] + row, row - own_rows[0]
        for column in range(index.shape[1]):
            s, x = index[row, column], corner[1] + column
            if s < 0:
                for c in range(channels):
                    equations[to, column, c] = 0.0
                continue
            for c in range(channels):
                sums[c] = 0.0
            for m in range(columns.shape[0]):
                support = supports[m]
                begin, end = bands, -1
                least, most = 0, 0
                whole, rest = 2 * support // step, 2 * support % step
                for j in range(bands):
                    low[j], high[j] = frames, -1
                    if inside[m, j, s]:
                        at = columns[m, j, s] - first
                        least, most = (at, at) if end < 0 else (min(least, at), max(most, at))
                        begin, end = min(begin, j), j
                        # Half an entry makes the division safe from rounding; one of integers takes long.
                        line = math.floor((at + support + 0.5) / step)
                        phase[j] = at + support - line * step
                        # What frame k shows is at `place + k`.
                        place[j], bright[j] = last - line, white[m, colour[s], j]
                        low[j] = max(line - whole + (1 if phase[j] >= rest else 0), lit[m, 0])
                        high[j] = min(line - (1 if phase[j] == 0 else 0), lit[m, 1] - 1)
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
                    right, grey = 0.0, 0.0
                    from_k, light = low[j] & MOST, phase[j] & MOST
                    from_place = (place[j] + low[j]) & MOST
                    for k in range(max(high[j] + 1 - low[j], 0) & MOST):
                        own[from_k + k] = weight[from_k + k] * tables[m, light, from_place + k]
                        right += own[from_k + k] * value[from_k + k]
                        grey += own[from_k + k]
                    sums[at_right + j] += bright[j] * right
                    if with_offsets:
                        sums[at_square + 2 + j] += bright[j] * grey
                    for o in range(min(size, end + 1 - j)):
                        both, begin_k = 0.0, max(low[j], low[j + o])
                        from_k, light = begin_k & MOST, phase[j + o] & MOST
                        from_place = (place[j + o] + begin_k) & MOST
                        for k in range(max(min(high[j], high[j + o]) + 1 - begin_k, 0) & MOST):
                            both += own[from_k + k] * tables[m, light, from_place + k]
                        sums[j * size + o] += bright[j] * bright[j + o] * both
            for j in range(bands):
                sums[j * size] *= 1.0 + surplus
                if with_offsets:
                    sums[at_square + 2 + j] *= sums[at_square + 2 + j] * offset_variance[s]
            for c in range(channels):
                equations[to, column, c] = sums[c]
