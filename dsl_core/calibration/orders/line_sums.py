"""Sums over scan lines and pixels: millions of numbers, which array operations would copy a dozen times.

Arrays are (frames, P); frames are lines.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dsl_core.solve.compiled import compiled

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@compiled
def zero_sums(
    radiance: Floats, expected: Floats, distance: Floats, near_px: float, unlit_px: tuple[float, float]
) -> Floats:
    """Sums of radiance, expected light and frames, (6, P): where lines are near, and where none is lit."""
    frames, count = radiance.shape
    sums = np.zeros((6, count))
    for f in range(frames):
        for p in range(count):
            apart = abs(distance[f, p])
            if apart < near_px:
                sums[0, p] += radiance[f, p]
                sums[1, p] += expected[f, p]
                sums[2, p] += 1
            if unlit_px[0] < apart < unlit_px[1]:
                sums[3, p] += radiance[f, p]
                sums[4, p] += expected[f, p]
                sums[5, p] += 1
    return sums


@compiled
def take_out(
    radiance: Floats,
    std: Floats,
    expected: Floats,
    slope: Floats,
    distance: Floats,
    amplitude: Floats,
    offset: Floats,
    near_px: float,
) -> tuple[Floats, Floats, Floats]:
    """Signal without dark signal and zero order, its variance, and sums for how far the zero order moved.

    The sums are of squared lever, lever times signal, and squared lever times deviation, where lines are
    near; the lever is what the signal changes by in a column.
    """
    frames, count = radiance.shape
    signal, variance, sums = np.empty((frames, count)), np.empty((frames, count)), np.zeros(3)
    for f in range(frames):
        for p in range(count):
            left = radiance[f, p] - offset[p] - amplitude[p] * expected[f, p]
            signal[f, p], variance[f, p] = left, std[f, p] ** 2
            if abs(distance[f, p]) < near_px:
                lever = amplitude[p] * slope[f, p]
                sums[0] += lever * lever
                sums[1] += lever * left
                sums[2] += (lever * std[f, p]) ** 2
    return signal, variance, sums


@compiled
def window_sums(
    signal: Floats, variance: Floats, distance: Floats, centre: Floats, half_px: float
) -> tuple[Floats, Floats]:
    """Signal and variance (P,) of lines within half a window of a distance (P,)."""
    frames, count = signal.shape
    light, noise = np.zeros(count), np.zeros(count)
    for f in range(frames):
        for p in range(count):
            if abs(distance[f, p] - centre[p]) < half_px:
                light[p] += signal[f, p]
                noise[p] += variance[f, p]
    return light, noise


@compiled
def histograms(
    signal: Floats, variance: Floats, amplitude: Floats, distance: Floats, cell: Ints, cells: int,
    ends_px: tuple[float, float], bin_px: float,
) -> Floats:  # fmt: skip
    """Light, variance and amplitude of lines by distance, (cells, 3, bins).

    ``cell`` (P,) says which a pixel is of, -1 none; the bins cover what is between the ends.
    """
    low, high = ends_px
    frames, count = signal.shape
    found = np.zeros((cells, 3, int((high - low) / bin_px) + 1))
    for f in range(frames):
        for p in range(count):
            at = distance[f, p]
            if cell[p] < 0 or not low < at < high:
                continue
            mine = found[cell[p]]
            k = int((at - low) / bin_px)
            mine[0, k] += signal[f, p]
            mine[1, k] += variance[f, p]
            mine[2, k] += amplitude[p]
    return found
