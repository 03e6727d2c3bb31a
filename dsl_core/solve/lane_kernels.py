"""The banded solver as compiled code: eight pixels side by side, from samples' equations to the posterior.

It computes what `dsl_core.reconstruction.spectral.solving.solver` explains, in double precision, many times
as fast as tensors do on a processor. Those remain for a GPU; a test holds both together. Arrays of a block
are flat, one row of `LANES` numbers after the other, at offsets that are constant in the innermost loops:
only so do these become vector instructions. The length of the tuple ``diagonals`` is the bandwidth, constant
for the compiler because it is part of a type. Nothing is allocated here and no slice is taken, since both
take long to compile; all that call each other are here, as `dsl_core.solve.compiled` asks.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from dsl_core.solve.compiled import compiled, within

Array = Any
#: Pixels of a block, and broad-band rows of a pixel, the colours of the zero order.
LANES, ROWS = 8, 3
#: Pivots whose product is taken before its logarithm: that of eight numbers of single precision is a double.
TOGETHER = 8
#: Bits of a block's or pixel's number: cut to these it is not negative, and need not count from the end.
MOST = (1 << 32) - 1
#: Least variance of a band's reflectance, against rounding.
LEAST_VARIANCE = 1e-12
#: No more than this share of a pixel's samples goes into its spectrum: where they are few, the prior does.
MOST_SHARE = 1 / 3
#: What follows the window's columns: product of pivots, evidence, logarithms, whether a pivot is bad; what
#: broad rows have in common (6) and see (3); the factor of their small system (6) and its solution (3).
PRODUCT, EVIDENCE, LOGS, BAD, GRAM, SEEN, SMALL, INNER, SUMS = 0, 1, 2, 3, 4, 10, 13, 19, 22


@within
def eliminate(
    data: Array, extra: Array, right: Array, rows: Array, broad: bool, prior: Array, weight: Array,
    volume: Array, diagonals: tuple[int, ...], window: Array, factor: Array, keep: bool,
) -> None:  # fmt: skip
    """Factorise data, prior and what is ``extra`` on the diagonal, with right side and broad rows.

    ``volume`` (bands,) brings pivots near one. The window ends with the evidence; ``factor`` is written where
    it is to be kept: for each band the triangle, the inverse pivot, right side and broad rows.
    """
    band = len(diagonals)
    size = band + 1
    z0, y0 = size * size * LANES, (size * size + size) * LANES
    sums, step = y0 + size * ROWS * LANES, (band + 2 + ROWS) * LANES
    scratch = sums + SUMS * LANES
    for i in range(SUMS * LANES):
        window[sums + i] = 1.0 if i < LANES else 0.0
    count = prior.shape[1]
    last, last_z, last_y = band * size * LANES, z0 + band * LANES, y0 + band * ROWS * LANES
    # Columns come in at the end of the window and are eliminated at its beginning. What remains there after
    # the last one has come in reaches no other: nothing couples a band to one beyond the last.
    for j in range(-size, count):
        if j >= 0:
            if keep:
                for i in range(LANES):
                    inverse = 1.0 / window[i]
                    for a in range(band):
                        factor[j * step + a * LANES + i] = window[(a + 1) * LANES + i] * inverse
                    factor[j * step + band * LANES + i] = inverse
                    factor[j * step + size * LANES + i] = window[z0 + i]
                for i in range(ROWS * LANES):
                    factor[j * step + (size + 1) * LANES + i] = window[y0 + i]
            if broad:
                for i in range(LANES):
                    inverse = 1.0 / window[i]
                    a, b, c = window[y0 + i], window[y0 + LANES + i], window[y0 + 2 * LANES + i]
                    at, u, v, w = sums + i, a * inverse, b * inverse, c * inverse
                    window[at + GRAM * LANES] += u * a
                    window[at + (GRAM + 1) * LANES] += u * b
                    window[at + (GRAM + 2) * LANES] += u * c
                    window[at + (GRAM + 3) * LANES] += v * b
                    window[at + (GRAM + 4) * LANES] += v * c
                    window[at + (GRAM + 5) * LANES] += w * c
                    window[at + SEEN * LANES] += u * window[z0 + i]
                    window[at + (SEEN + 1) * LANES] += v * window[z0 + i]
                    window[at + (SEEN + 2) * LANES] += w * window[z0 + i]
                    for k in range(1, size):
                        low, to = window[k * LANES + i] * inverse, y0 + (k - 1) * ROWS * LANES + i
                        window[to] = window[to + ROWS * LANES] - low * a
                        window[to + LANES] = window[to + (ROWS + 1) * LANES] - low * b
                        window[to + 2 * LANES] = window[to + (ROWS + 2) * LANES] - low * c
            near = volume[j]
            for i in range(LANES):
                for k in range(size):
                    window[scratch + k * LANES + i] = window[k * LANES + i]
                pivot, z = window[i], window[z0 + i]
                inverse = 1.0 / pivot
                window[sums + PRODUCT * LANES + i] *= pivot * near
                window[sums + EVIDENCE * LANES + i] += z * z * inverse
                sound = pivot > 0.0 and pivot < np.inf
                window[sums + BAD * LANES + i] = window[sums + BAD * LANES + i] if sound else 1.0
                for k in range(1, size):
                    low = window[scratch + k * LANES + i] * inverse
                    window[z0 + (k - 1) * LANES + i] = window[z0 + k * LANES + i] - low * z
                    for b in range(k, size):
                        window[((k - 1) * size + b - k) * LANES + i] = (
                            window[(k * size + b - k) * LANES + i] - low * window[scratch + b * LANES + i]
                        )
                    for o in range(size - k, size):
                        window[((k - 1) * size + o) * LANES + i] = window[(k * size + o) * LANES + i]
            if j % TOGETHER == TOGETHER - 1:
                for i in range(LANES):
                    window[sums + LOGS * LANES + i] += math.log(window[sums + PRODUCT * LANES + i])
                    window[sums + PRODUCT * LANES + i] = 1.0
        else:
            for i in range(last):
                window[i] = window[i + size * LANES]
            for i in range(band * LANES):
                window[z0 + i] = window[z0 + LANES + i]
            for i in range(band * ROWS * LANES):
                window[y0 + i] = window[y0 + ROWS * LANES + i]
        k = j + size
        if k < count:
            main, beside, next_but_one, ridge = prior[0, k], prior[1, k], prior[2, k], prior[3, k]
            own, of_k = k * size * LANES, k * LANES
            for i in range(LANES):
                window[last + i] = data[own + i] + main * weight[i] + (ridge + extra[of_k + i])
                window[last + LANES + i] = data[own + LANES + i] + beside * weight[i]
                window[last + 2 * LANES + i] = data[own + 2 * LANES + i] + next_but_one * weight[i]
                window[last_z + i] = right[of_k + i]
            for i in range(3 * LANES, size * LANES):
                window[last + i] = data[own + i]
            if broad:
                for i in range(ROWS * LANES):
                    window[last_y + i] = rows[k * ROWS * LANES + i]
    for i in range(LANES):
        logs = window[sums + LOGS * LANES + i] + math.log(window[sums + PRODUCT * LANES + i])
        window[sums + EVIDENCE * LANES + i] -= logs
    if broad:
        eliminate_small(window, sums)


@within
def eliminate_small(window: Array, sums: int) -> None:
    """Solve the system of the broad rows, one plus what they have in common, and correct the evidence."""
    for i in range(LANES):
        gram, seen, small, inner = (
            sums + GRAM * LANES + i, sums + SEEN * LANES + i, sums + SMALL * LANES + i,
            sums + INNER * LANES + i,
        )  # fmt: skip
        p0 = 1.0 + window[gram]
        l10, l20 = window[gram + LANES] / p0, window[gram + 2 * LANES] / p0
        p1 = 1.0 + window[gram + 3 * LANES] - l10 * window[gram + LANES]
        left = window[gram + 4 * LANES] - l20 * window[gram + LANES]
        l21 = left / p1
        p2 = 1.0 + window[gram + 5 * LANES] - l20 * window[gram + 2 * LANES] - l21 * left
        z0 = window[seen]
        z1 = window[seen + LANES] - l10 * z0
        z2 = window[seen + 2 * LANES] - l20 * z0 - l21 * z1
        window[sums + EVIDENCE * LANES + i] -= (
            z0 * z0 / p0 + z1 * z1 / p1 + z2 * z2 / p2 + math.log(p0 * p1 * p2)
        )
        window[sums + BAD * LANES + i] = window[sums + BAD * LANES + i] if p1 > 0.0 and p2 > 0.0 else 1.0
        x2 = z2 / p2
        x1 = z1 / p1 - l21 * x2
        window[small] = l10
        window[small + LANES] = l20
        window[small + 2 * LANES] = l21
        window[small + 3 * LANES] = 1.0 / p0
        window[small + 4 * LANES] = 1.0 / p1
        window[small + 5 * LANES] = 1.0 / p2
        window[inner] = z0 / p0 - l10 * x1 - l20 * x2
        window[inner + LANES] = x1
        window[inner + 2 * LANES] = x2


@within
def substitute(
    factor: Array, broad: bool, diagonals: tuple[int, ...], count: int, window: Array, x: Array
) -> None:
    """The solution ``x``, with as many zeros before and behind as there are diagonals, from a factor kept."""
    band = len(diagonals)
    size, step = band + 1, (band + 2 + ROWS) * LANES
    inner = (size * size + size + size * ROWS + INNER) * LANES
    for j in range(count - 1, -1, -1):
        own, to = j * step, (j + band) * LANES
        for i in range(LANES):
            value = factor[own + size * LANES + i]
            if broad:
                for r in range(ROWS):
                    value -= factor[own + (size + 1 + r) * LANES + i] * window[inner + r * LANES + i]
            value *= factor[own + band * LANES + i]
            for a in range(band):
                value -= factor[own + a * LANES + i] * x[to + (a + 1) * LANES + i]
            x[to + i] = value


@within
def inverse_near_diagonal(
    factor: Array, diagonals: tuple[int, ...], count: int, block: Array, near: Array
) -> None:
    """The inverse's main diagonal and the two beside it, ``near`` (bands x 3), by Takahashi's recursion."""
    band = len(diagonals)
    step, row = (band + 2 + ROWS) * LANES, band * band * LANES
    for i in range(row):
        block[i] = 0.0
    for j in range(count - 1, -1, -1):
        own = j * step
        for i in range(LANES):
            pivot = factor[own + band * LANES + i]
            for a in range(band):
                value = 0.0
                for b in range(band):
                    value -= factor[own + b * LANES + i] * block[(a * band + b) * LANES + i]
                block[row + a * LANES + i] = value
                pivot -= factor[own + a * LANES + i] * value
            for a in range(band - 1, 0, -1):
                for b in range(band - 1, 0, -1):
                    block[(a * band + b) * LANES + i] = block[((a - 1) * band + b - 1) * LANES + i]
            for b in range(1, band):
                value = block[row + (b - 1) * LANES + i]
                block[b * LANES + i] = value
                block[b * band * LANES + i] = value
            block[i] = pivot
            near[j * 3 * LANES + i] = pivot
            near[(j * 3 + 1) * LANES + i] = block[row + i]
            near[(j * 3 + 2) * LANES + i] = block[row + LANES + i]


@within
def variance_of_means(
    factor: Array, broad: bool, diagonals: tuple[int, ...], count: int, window: Array, block: Array,
    near: Array, spread: Array, variance: Array,
) -> None:  # fmt: skip
    """Variance of the band means, (bands); the outermost repeat their neighbours."""
    band = len(diagonals)
    size, step, margin = band + 1, (band + 2 + ROWS) * LANES, (count + 2 * band) * LANES
    small = (size * size + size + size * ROWS + SMALL) * LANES
    inverse_near_diagonal(factor, diagonals, count, block, near)
    if broad:
        for r in range(ROWS):
            for j in range(count - 1, -1, -1):
                own, to = j * step, r * margin + (j + band) * LANES
                for i in range(LANES):
                    value = factor[own + (size + 1 + r) * LANES + i] * factor[own + band * LANES + i]
                    for a in range(band):
                        value -= factor[own + a * LANES + i] * spread[to + (a + 1) * LANES + i]
                    spread[to + i] = value
    for j in range(1, count - 1):
        at, before, after = j * 3 * LANES, (j - 1) * 3 * LANES, (j + 1) * 3 * LANES
        for i in range(LANES):
            main = near[before + i] + 16.0 * near[at + i] + near[after + i]
            beside = near[before + LANES + i] + near[at + LANES + i]
            variance[j * LANES + i] = (main + 8.0 * beside + 2.0 * near[before + 2 * LANES + i]) / 36.0
        if broad:
            to = (j + band) * LANES
            for i in range(LANES):
                u = mean3(spread, to + i)
                v = mean3(spread, to + margin + i) - window[small + i] * u
                w = mean3(spread, to + 2 * margin + i) - window[small + LANES + i] * u
                w -= window[small + 2 * LANES + i] * v
                taken = u * u * window[small + 3 * LANES + i] + v * v * window[small + 4 * LANES + i]
                variance[j * LANES + i] -= taken + w * w * window[small + 5 * LANES + i]
    for i in range(LANES):
        variance[i] = variance[LANES + i]
        variance[(count - 1) * LANES + i] = variance[(count - 2) * LANES + i]


@within
def mean3(x: Array, at: int) -> float:
    """Mean of a band's triangle from the nodes around it."""
    value: float = (x[at - LANES] + 4.0 * x[at] + x[at + LANES]) / 6.0
    return value


@within
def multiply(data: Array, diagonals: tuple[int, ...], count: int, x: Array, out: Array) -> None:
    """Product of the banded data with ``x`` (bands with a margin), of the same shape."""
    band = len(diagonals)
    size = band + 1
    for i in range((count + 2 * band) * LANES):
        out[i] = 0.0
    for j in range(count):
        at, own = (j + band) * LANES, j * size * LANES
        for i in range(LANES):
            here, total = x[at + i], out[at + i] + data[own + i] * x[at + i]
            for o in range(1, size):
                value = data[own + o * LANES + i]
                total += value * x[at + o * LANES + i]
                out[at + o * LANES + i] += value * here
            out[at + i] = total


@within
def pin(
    data: Array, right: Array, prior: Array, weight: Array, diagonals: tuple[int, ...], bounds: Array,
    x: Array, slope: Array, pinned: Array, todo: Array, wanted: Array, stiffness: Array, stiff_right: Array,
) -> bool:  # fmt: skip
    """Choose the bands that are held at a bound next; False when none changes in any pixel ``todo``."""
    band, count = len(diagonals), prior.shape[1]
    low, high, tolerance, penalty = bounds[0], bounds[1], bounds[2], bounds[3]
    middle, any_moved = 0.5 * (low + high), False
    for i in range(LANES):
        moved = False
        if todo[i]:
            for j in range(count):
                at, k = (j + band) * LANES + i, j * LANES + i
                free = slope[at] < 0.0 if x[at] < middle else slope[at] > 0.0
                out = x[at] < low - tolerance or x[at] > high + tolerance
                wanted[k] = (pinned[k] and not free) or out
                moved |= wanted[k] != pinned[k]
        todo[i] = moved
        any_moved |= moved
    for j in range(count):
        for i in range(LANES):
            k = j * LANES + i
            stiffness[k], stiff_right[k] = 0.0, right[k]
            if todo[i] and wanted[k]:
                main = data[j * (band + 1) * LANES + i] + prior[0, j] * weight[i] + prior[3, j]
                stiffness[k] = penalty * main
                stiff_right[k] += stiffness[k] * (low if x[(j + band) * LANES + i] < middle else high)
    return any_moved


@within
def gradient(
    data: Array, right: Array, rows: Array, broad: bool, prior: Array, weight: Array,
    diagonals: tuple[int, ...], x: Array, out: Array,
) -> None:  # fmt: skip
    """Gradient of the quadratic with data, prior and broad rows at ``x`` (bands with a margin)."""
    band, count = len(diagonals), prior.shape[1]
    multiply(data, diagonals, count, x, out)
    for i in range(LANES):
        for r in range(ROWS if broad else 0):
            seen = 0.0
            for j in range(count):
                seen += rows[(j * ROWS + r) * LANES + i] * x[(j + band) * LANES + i]
            for j in range(count):
                out[(j + band) * LANES + i] += rows[(j * ROWS + r) * LANES + i] * seen
        for j in range(count):
            at = (j + band) * LANES + i
            out[at] += (prior[0, j] * weight[i] + prior[3, j]) * x[at] - right[j * LANES + i]
            for o in (1, 2):
                if j + o < count:
                    out[at] += prior[o, j] * weight[i] * x[at + o * LANES]
                if j - o >= 0:
                    out[at] += prior[o, j - o] * weight[i] * x[at - o * LANES]


@compiled
def solve_blocks(
    equations: Array, index: Array, shading: Array, offsets: bool, rows: Array, levels: Array, prior: Array,
    volumes: Array, taus: Array, bounds: Array, level: float, uneven: float, local: float, parameters: float,
    diagonals: tuple[int, ...], work: tuple[Array, ...], solutions: tuple[Array, ...], candidates: Array,
    marks: tuple[Array, ...], nodes: Array, mean: Array, std: Array, share: Array, at_bound: Array,
    tau: Array, misfit: Array,
) -> bool:  # fmt: skip
    """Solve pixels from the sums of their samples' equations; False where a system is not positive definite.

    ``equations`` are (rows, columns, channels), see `dsl_core.optics.lines.sums`, of pixels with ``shading``.
    ``index`` is the pixel's place in the results, negative where none is wanted. ``rows`` (rows, bands, 3,
    columns) are broad-band equations of values ``levels`` (rows, 3, columns), both empty where there are
    none. ``prior`` (4, bands) are the diagonals of squared second differences and of the level. Results are
    (bands, pixels), ``tau`` and ``misfit`` (pixels,).
    """
    band, count = len(diagonals), prior.shape[1]
    size = band + 1
    at_right, at_square = count * size * LANES, (count * size + count) * LANES
    channels = count * size + count + 2 + (count if offsets else 0)
    sums, right, extra, stiff_right, broad_rows, window, factor, inverse, near, spread = work
    x, solved, slope, product, ones, variance = solutions
    weight = candidates[0]
    pinned, wanted, used, todo = marks
    at_sums = (size * size + size + size * ROWS) * LANES
    bad, evident = at_sums + BAD * LANES, at_sums + EVIDENCE * LANES
    for y in range(index.shape[0]):
        for block in range(index.shape[1] // LANES):
            x0 = (block & MOST) * LANES
            any_used = False
            for i in range(LANES):
                used[i] = index[y, x0 + i] >= 0
                any_used |= used[i]
            if not any_used:
                continue
            for c in range(channels):
                for i in range(LANES):
                    sums[c * LANES + i] = equations[y, x0 + i, c]
            broad = x0 < 0  # no literal: parts would be compiled once for it and once for any other
            for j in range(count):
                for i in range(LANES):
                    right[j * LANES + i] = sums[at_right + j * LANES + i] + level * prior[3, j]
            if rows.size:
                for j in range(count):
                    for r in range(ROWS):
                        for i in range(LANES):
                            value = np.float64(rows[y, j, r, x0 + i])
                            broad |= value != 0.0
                            broad_rows[(j * ROWS + r) * LANES + i] = value
                            right[j * LANES + i] += value * levels[y, r, x0 + i]
            for k in range(count * LANES):
                pinned[k], extra[k], stiff_right[k] = False, 0.0, right[k]
            for i in range(LANES):
                todo[i] = used[i]
            # The candidates for the smoothness, then the best of them, then bands held at a bound.
            for stage in range(len(taus) + 1 + int(bounds[4])):
                if stage < len(taus):
                    for i in range(LANES):
                        weight[i] = 1.0 / (taus[stage] * taus[stage])
                elif stage == len(taus):
                    for i in range(LANES):
                        chosen = math.exp(most_evident(candidates, i, taus))
                        weight[i] = 1.0 / (chosen * chosen)
                        if used[i]:
                            tau[index[y, x0 + i]] = chosen
                elif not pin(
                    sums, right, prior, weight, diagonals, bounds, x, slope, pinned, todo, wanted, extra,
                    stiff_right,
                ):  # fmt: skip
                    break
                eliminate(
                    sums, extra, stiff_right, broad_rows, broad, prior, weight,
                    volumes[min(stage, len(taus) - 1)], diagonals, window, factor, stage >= len(taus),
                )  # fmt: skip
                if stage < len(taus):
                    for i in range(LANES):
                        candidates[stage + 1, i] = window[evident + i]
                    continue
                substitute(factor, broad, diagonals, count, window, solved)
                if stage == len(taus):
                    variance_of_means(
                        factor, broad, diagonals, count, window, inverse, near, spread, variance
                    )
                else:
                    gradient(sums, right, broad_rows, broad, prior, weight, diagonals, solved, slope)
                for i in range(LANES):
                    if used[i] and window[bad + i] != 0.0:
                        return False
                    if todo[i]:
                        for j in range(count):
                            x[(j + band) * LANES + i] = solved[(j + band) * LANES + i]
                            pinned[j * LANES + i] = wanted[j * LANES + i] and stage > len(taus)
            for k in range(band * LANES, (count + band) * LANES):
                x[k] = min(max(x[k], bounds[0]), bounds[1])
            if offsets:
                multiply(sums, diagonals, count, ones, product)
                for j in range(count):
                    for i in range(LANES):
                        grey = (product[(j + band) * LANES + i] + prior[3, j]) / shading[y, x0 + i]
                        change = sums[at_square + (2 + j) * LANES + i] / (grey * grey)
                        variance[j * LANES + i] = max(variance[j * LANES + i], LEAST_VARIANCE) + change
            multiply(sums, diagonals, count, x, product)
            deviations(x, band, count, uneven, extra, stiff_right, variance)
            shares_of_data(sums, size, count, local)
            for i in range(LANES):
                if used[i]:
                    explained = 0.0
                    for j in range(count):
                        at = (j + band) * LANES + i
                        explained += x[at] * (2.0 * sums[at_right + j * LANES + i] - product[at])
                    samples = sums[at_square + LANES + i]
                    freedom = max(samples - min(parameters, MOST_SHARE * samples), 1.0)
                    misfit[index[y, x0 + i]] = (sums[at_square + i] - explained) / freedom
            for j in range(count):
                before, after = LANES if j else 0, LANES if j < count - 1 else 0
                for i in range(LANES):
                    if used[i]:
                        p, at = index[y, x0 + i] & MOST, (j + band) * LANES + i
                        nodes[j, p], std[j, p] = x[at], variance[j * LANES + i]
                        mean[j, p] = (x[at - before] + 4.0 * x[at] + x[at + after]) / 6.0
                        share[j, p] = sums[j * size * LANES + i]
                        at_bound[j, p] = pinned[j * LANES + i]
    return True


@within
def most_evident(candidates: Array, i: int, taus: Array) -> float:
    """Logarithm of the smoothness at the peak of a parabola through the best candidate and its neighbours."""
    best = 0
    for t in range(len(taus)):
        if candidates[t + 1, i] > candidates[best + 1, i]:
            best = t
    best = min(max(best, 1), len(taus) - 2)
    left, middle, right = candidates[best, i], candidates[best + 1, i], candidates[best + 2, i]
    curvature = 2.0 * middle - left - right
    shift = 1.0 if right > left else (-1.0 if right < left else 0.0)
    if curvature > 0.0:
        shift = min(max(0.5 * (right - left) / max(curvature, 1e-6), -1.0), 1.0)
    place: float = math.log(taus[best]) + shift * (math.log(taus[1]) - math.log(taus[0]))
    return place


@within
def deviations(
    x: Array, band: int, count: int, uneven: float, second: Array, fourth: Array, variance: Array
) -> None:
    """Make a deviation of every ``variance`` (bands,), with what a band's mean may be off its middle.

    That is ``uneven`` times the ``second`` or ``fourth`` difference, whichever is larger; the outermost ones
    repeat their neighbours. Both are overwritten.
    """
    # One loop over bands and lanes: a short one would not become vector instructions.
    last, margin = (count - 1) * LANES, band * LANES
    for k in range(LANES, last):
        at = margin + k
        second[k] = x[at - LANES] - 2.0 * x[at] + x[at + LANES]
    repeat_ends(second, last)
    for k in range(LANES, last):
        fourth[k] = second[k - LANES] - 2.0 * second[k] + second[k + LANES]
    repeat_ends(fourth, last)
    for k in range(last + LANES):
        unsure = uneven * max(abs(second[k]), abs(fourth[k]))
        variance[k] = math.sqrt(max(variance[k], LEAST_VARIANCE) + unsure * unsure)


@within
def repeat_ends(values: Array, last: int) -> None:
    """Have the first band and the ``last`` repeat the ones beside them."""
    for i in range(LANES):
        values[i] = values[LANES + i]
        values[last + i] = values[last - LANES + i]


@within
def shares_of_data(data: Array, size: int, count: int, local: float) -> None:
    """Make the main diagonal the share of each band's answer that data within two bands of it decide."""
    for j in range(count):
        own = j * size * LANES
        for o in range(1, min(3, size)):
            for i in range(LANES):
                data[own + i] += data[own + o * LANES + i]
            if j >= o:
                before = own - o * (size - 1) * LANES
                for i in range(LANES):
                    data[own + i] += data[before + i]
        for i in range(LANES):
            data[own + i] /= data[own + i] + local
