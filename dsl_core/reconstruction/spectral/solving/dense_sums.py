"""Normal equations of patterns that couple distant bands, one sample after the other, as compiled code.

It adds up what `dsl_core.optics.pixel_model.PixelModel.equations` explains and does with tensors, which
remain for a GPU; a test holds both together. Only the upper triangle of a matrix is kept, row after row, so
that the sums over neighbouring samples and the solver pass through half as many numbers.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from dsl_core.optics.image_formation import MARGIN_PX, OVERSAMPLE
from dsl_core.solve.compiled import compiled, within

Array = Any
#: Frames that are added at a time, so that the matrix is passed through once for all of them.
TOGETHER = 4
#: Bits of a number: cut to these it is not negative, and need not count from an array's end.
MOST = (1 << 32) - 1


@compiled
def add_dense(
    radiance: Array, weight: Array, colour: Array, offset_variance: Array, index: Array,
    own_rows: tuple[int, int], column_px: Array, direct: Array, columns_px: Array, inside: Array,
    tables: Array, moments: Array, equations: Array,
) -> None:  # fmt: skip
    """Equations (rows, columns, channels) of unit shading of the samples in some rows of a grid.

    Channels are those of `dsl_core.solve.dense_kernels.channels`. ``index`` (rows, columns) of the grid is a
    sample's place in the lists, negative where there is none; ``own_rows`` are those to fill, from the first
    of ``equations`` on. ``radiance`` and ``weight`` are (samples, frames), ``colour`` and ``offset_variance``
    (samples,). ``tables`` (orders, steps, LEDs, frames) are the patterns' light over the projector's columns,
    as `BlurredProfiles` has it, of the zero order first; ``moments`` are (orders, 3, LEDs, bands). The zero
    order's ``column_px`` and whether it is ``direct`` are (samples,); ``columns_px`` and ``inside`` of all
    other orders are (orders, bands, samples).
    """
    frames, bands = radiance.shape[1], columns_px.shape[1]
    whole = -(-frames // TOGETHER) * TOGETHER
    seen, value, heavy = np.zeros(bands * frames), np.zeros(whole), np.zeros(whole)
    rows, sums = np.zeros(whole * bands), np.zeros(equations.shape[2])
    triangle = bands * (bands + 1) // 2
    for row in range(own_rows[0], own_rows[1]):
        for column in range(index.shape[1]):
            s = index[row, column]
            for c in range(len(sums)):
                sums[c] = 0.0
            if s >= 0:
                see(s & MOST, colour[s], column_px[s], direct[s], columns_px, inside, tables, moments, seen)
                for f in range(frames):
                    value[f], heavy[f] = radiance[s, f], weight[s, f]
                    sums[triangle + bands + 1] += 1.0 if weight[s, f] > 0.0 else 0.0
                if offset_variance[s] > 0.0:
                    without_offset(seen, value, heavy, frames, bands, offset_variance[s])
                for f in range(frames):
                    sums[triangle + bands] += heavy[f] * value[f] * value[f]
                    for j in range(bands):
                        rows[f * bands + j] = seen[j * frames + f]
                add_frames(rows, value, heavy, whole, bands, sums)
            for c in range(len(sums)):
                equations[row - own_rows[0], column, c] = sums[c]


@within
def see(
    s: int, colour: int, column_px: float, direct: bool, columns_px: Array, inside: Array, tables: Array,
    moments: Array, seen: Array,
) -> None:  # fmt: skip
    """What a sample sees of each band in each frame, ``seen`` (bands x frames), all orders together."""
    bands, leds, frames = columns_px.shape[1], tables.shape[2], tables.shape[3] & MOST
    for k in range(len(seen)):
        seen[k] = 0.0
    for m in range(len(tables)):
        for j in range(bands):
            if m == 0:
                lit, at = direct, column_px
            else:
                lit, at = inside[m - 1, j, s], columns_px[m - 1, j, s]
            if not lit:
                continue
            place = (at + 0.5 + MARGIN_PX) * OVERSAMPLE - 0.5
            place = min(max(place, 0.0), tables.shape[1] - 1.001)
            low = int(place) & MOST
            part, to = place - low, (j * frames) & MOST
            for led in range(leds):
                before = moments[m, colour, led, j] * (1.0 - part)
                after = moments[m, colour, led, j] * part
                for f in range(frames):
                    seen[to + f] += before * tables[m, low, led, f] + after * tables[m, low + 1, led, f]


@within
def without_offset(seen: Array, value: Array, heavy: Array, frames: int, bands: int, variance: float) -> None:
    """Take as much of the frames' mean out as an offset they all share takes of it, see `PixelModel`."""
    total, mean = 0.0, 0.0
    for f in range(frames):
        total += heavy[f]
        mean += heavy[f] * value[f]
    share = (1.0 - 1.0 / math.sqrt(1.0 + variance * total)) / max(total, 1e-30)
    for f in range(frames):
        value[f] -= share * mean
    for j in range(bands):
        mean = 0.0
        for f in range(frames):
            mean += heavy[f] * seen[j * frames + f]
        for f in range(frames):
            seen[j * frames + f] -= share * mean


@within
def add_frames(rows: Array, value: Array, heavy: Array, frames: int, bands: int, sums: Array) -> None:
    """Add the equations of frames, ``rows`` (frames x bands), to the matrix's triangle and the right side."""
    right = bands * (bands + 1) // 2
    for f in range(0, frames, TOGETHER):
        a, b = (f * bands) & MOST, ((f + 1) * bands) & MOST
        c, d = ((f + 2) * bands) & MOST, ((f + 3) * bands) & MOST
        begin = 0
        for j in range(bands):
            l0, l1 = heavy[f] * rows[a + j], heavy[f + 1] * rows[b + j]
            l2, l3 = heavy[f + 2] * rows[c + j], heavy[f + 3] * rows[d + j]
            sums[right + j] += (l0 * value[f] + l1 * value[f + 1]) + (l2 * value[f + 2] + l3 * value[f + 3])
            to = (begin - j) & MOST
            for k in range(j & MOST, bands & MOST):
                pair = l0 * rows[a + k] + l1 * rows[b + k]
                sums[to + k] += pair + (l2 * rows[c + k] + l3 * rows[d + k])
            begin += bands - j
