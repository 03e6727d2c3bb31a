"""The sum over unlit frames of `dsl_core.reconstruction.columns.dark_offset`, pixel by pixel, compiled.

Tensors need thirty passes over as many numbers as there are unlit frames of all pixels; a loop needs one.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from dsl_core.solve.compiled import compiled_for

Array = Any


@compiled_for(
    "void(float32[:], float32[:], float32[:,:], uint16[:,:], float32[::1], int64[::1], float32[:,::1],"
    " float64[::1], int64, int64, int64, float64, float64, float32[::1], float32[::1])"
)
def unlit_means(
    beside: Array, amplitude: Array, radiance: Array, halves: Array, variances: Array, nearest: Array,
    halos: Array, falls: Array, first: int, lines: int, step: int, low: float, high: float,
    offset: Array, std: Array,
) -> None:  # fmt: skip
    """Weighted mean of the unlit frames of each pixel into ``offset``, its deviation into ``std`` (pixels,).

    ``radiance`` (frames, pixels) comes with the bits of its deviation in ``halves``, which stand for
    ``variances``. ``nearest`` is the line next to a pixel's column, which is ``beside`` its middle by less
    than a ``step`` (px). Of the ``lines``, each of which has a frame of its own, those count that are from
    ``low`` to ``high`` (px) away: the ``first`` one beyond the nearest, and ``len(falls)`` in all, on either
    side. ``halos`` (2, pixels) are those of the first ones, relative to ``amplitude``, and ``falls`` how a
    halo falls from line to line.
    """
    for p in range(len(beside)):
        total, weight = 0.0, 0.0
        for after in range(2):
            side = 2 * after - 1
            for k in range(len(falls)):
                line = nearest[p] + side * (first + k)
                distance = (first + k) * step - side * beside[p]
                if line < 0 or line >= lines or not low <= distance <= high:
                    continue
                # An infinite deviation has no weight by itself; of one that is no number nothing is known.
                variance = np.float64(variances[halves[line, p]])
                heavy = 1e18 if variance < 1e-18 else 1.0 / variance
                weight += heavy
                if heavy > 0.0:
                    total += heavy * (radiance[line, p] - amplitude[p] * halos[after, p] * falls[k])
        offset[p] = total / (1e-30 if weight < 1e-30 else weight)
        std[p] = 1.0 / np.sqrt(weight)
