"""Normal equations of a corner's window, summed over its pixels and the bits of a code."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dsl_core.solve.compiled import compiled

Floats = NDArray[np.float64]


@compiled
def normal_equations(
    terms: Floats, start: Floats, contrast: Floats, weight: Floats, values: Floats, slopes: Floats,
    oversample: int, strength: float, sigma: Floats, outlier_sigmas: float,
) -> tuple[Floats, Floats, int]:  # fmt: skip
    """Square (6, 6) and right side (6,) of a step of the map ``start``, and the pixels that say something.

    ``terms`` (pixels, 6) times the map are places in the blurred bits ``values`` and their ``slopes``,
    (samples, bits), which are linear between samples. ``contrast`` (pixels, bits) has the deviations
    ``sigma`` (bits,) over the root of ``weight`` (pixels,).
    """
    pixels, count = terms.shape
    samples, bits = values.shape
    square, right, informed = np.zeros((count, count)), np.zeros(count), 0
    for p in range(pixels):
        place = 0.0
        for k in range(count):
            place += terms[p, k] * start[k]
        position = min(max((place + 0.5) * oversample - 0.5, 0.0), samples - 1 - 1e-6)
        whole = int(position)
        part, root = position - whole, np.sqrt(weight[p])
        information, pull = 0.0, 0.0
        for b in range(bits):
            value = values[whole, b] * (1 - part) + values[whole + 1, b] * part
            slope = strength * (slopes[whole, b] * (1 - part) + slopes[whole + 1, b] * part)
            residual = contrast[p, b] - strength * value
            if abs(residual) * root <= outlier_sigmas * sigma[b]:
                each = weight[p] / sigma[b] ** 2
                information += each * slope * slope
                pull += each * slope * residual
        if information > 0:
            informed += 1
        for k in range(count):
            right[k] += terms[p, k] * pull
            for j in range(count):
                square[k, j] += terms[p, k] * terms[p, j] * information
    return square, right, informed
