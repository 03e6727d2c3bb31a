"""Loops over the pixels of a bracket's mosaics, compiled: merging them, and comparing their light.

Both go row by row, setting by setting, so that sums of a row stay in the processor's cache and the loops over
columns become vector instructions. For that a loop may use few arrays, whose overlap has to be ruled out
before it, and whole numbers must not grow to 64 bits. What is computed is explained where these are called
from.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from dsl_core.solve.compiled import compiled

Array = Any


@compiled
def merge_settings(
    raws: Array, black: Array, floor: Array, gains: Array, shots: Array, limit_dn: int,
    radiance: Array, variance: Array, halves: Array, saturated: Array,
) -> None:  # fmt: skip
    """Merge mosaics ``raws`` (settings, rows, columns) into ``radiance``, ``variance`` and ``saturated``.

    ``black`` and ``floor`` are as ``raws``, ``gains`` and ``shots`` (settings,); all in single precision.
    With ``halves`` (rows, columns) the bits of the deviation in half precision go there instead of
    ``variance``; the array that is not wanted is empty.
    """
    settings, rows, columns = raws.shape
    limit, u32 = np.uint16(limit_dn), np.uint32
    zero, one = np.float32(0), np.float32(1)
    total, weight = np.empty(columns, np.float32), np.empty(columns, np.float32)
    expected, heavy = np.empty(columns, np.float32), np.empty(columns, np.float32)
    bits, small = expected.view(np.uint32), heavy.view(np.uint32)
    for y in range(rows):
        for x in range(columns):
            total[x], weight[x] = zero, zero
        for s in range(settings):
            own = gains[s]
            for x in range(columns):
                # A saturated value drops out of every sum.
                used = raws[s, y, x] < limit
                weight[x] += own if used else zero
                total[x] += np.float32(raws[s, y, x]) - black[s, y, x] if used else zero
        shut = False
        for x in range(columns):
            level = total[x] / weight[x]
            # Negative becomes zero, and so does what is saturated everywhere and not a number here.
            expected[x] = level if level > zero else zero
            saturated[y, x] = weight[x] == zero
            shut |= weight[x] == zero
            total[x], weight[x] = zero, zero
        for s in range(settings):
            own, shot = gains[s], shots[s]
            for x in range(columns):
                heavy[x] = (own if raws[s, y, x] < limit else zero) / (expected[x] * shot + floor[s, y, x])
            for x in range(columns):
                weight[x] += heavy[x] * own
                total[x] += heavy[x] * (np.float32(raws[s, y, x]) - black[s, y, x])
        for x in range(columns):
            radiance[y, x] = total[x] / weight[x]
        if shut:
            for x in range(columns):
                if saturated[y, x]:
                    # The least radiance that saturates every setting.
                    bound = -np.float32(np.inf)
                    for s in range(settings):
                        bound = max(bound, (limit_dn - black[s, y, x]) / gains[s])
                    radiance[y, x] = bound
        if halves.size:
            for x in range(columns):
                std = np.sqrt(one / weight[x])
                # Added to a half, numbers below the least normal one of half precision round as they should.
                expected[x], heavy[x] = std, std + np.float32(0.5)
            for x in range(columns):
                odd = u32(u32(bits[x] >> u32(13)) & u32(1))
                normal = u32(u32(bits[x] + u32(0xFFF) + odd) >> u32(13))
                half = min(u32(normal - u32(112 << 10)), u32(0x7C00))
                halves[y, x] = half if bits[x] >= u32(113 << 23) else u32(small[x] - u32(126 << 23))
        else:
            for x in range(columns):
                variance[y, x] = one / weight[x]


@compiled
def light_sums(
    faint: Array, bright: Array, black_faint: Array, black_bright: Array,
    low: float, high: float, scale: float, floor: float, electrons: float,
) -> tuple[int, float, float, float]:  # fmt: skip
    """Pixels of two settings that can be compared, and what a fit of one as a multiple of the other needs.

    Mosaics and blacks are (rows, columns). Returns how many pixels have light above ``low`` in the bright
    one and counts below ``high`` in both; the sums of their squared bright light less its noise, of the
    products of both lights, and of their squared faint light, weighted by the noise that the faint one has
    for light ``scale`` times the bright one. ``floor`` is the variance of counts without light.
    """
    rows, columns = faint.shape
    count, power, product, square = (
        np.zeros(columns),
        np.zeros(columns),
        np.zeros(columns),
        np.zeros(columns),
    )
    for y in range(rows):
        for x in range(columns):
            light = np.float64(np.float32(bright[y, x]) - black_bright[y, x])
            other = np.float64(np.float32(faint[y, x]) - black_faint[y, x])
            used = light > low and bright[y, x] < high and faint[y, x] < high
            shot = max(light, 0.0) / electrons
            # Of the frame and of the black taken off it.
            weight = (1.0 if used else 0.0) / (2.0 * floor + scale * shot)
            count[x] += 1.0 if used else 0.0
            power[x] += weight * (light * light - floor - shot)
            product[x] += weight * light * other
            square[x] += weight * other * other
    return int(count.sum()), power.sum(), product.sum(), square.sum()
