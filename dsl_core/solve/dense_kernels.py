"""Full systems of spectra as compiled code: from a pixel's equations to its posterior, one after the other.

It computes what `dsl_core.reconstruction.spectral.solving.dense_solver` explains, in double precision. Those
tensors remain for a GPU; a test holds both together. Rows are eliminated in panels, so that the matrix, which
stays in the processor's cache, is passed through once a panel. A row begins at a multiple of the panel and
has a whole number of them; the right side comes behind the last one. Offsets are cut to positive numbers:
only so do the innermost loops become vector instructions.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from dsl_core.solve.compiled import compiled, within

Array = Any
#: Rows that are eliminated together.
PANEL = 8
#: Bits of a number: cut to these it is not negative, and need not count from an array's end.
MOST = (1 << 32) - 1


def panelled(bands: int) -> int:
    """The number of bands rounded up to whole panels."""
    return -(-bands // PANEL) * PANEL


def channels(bands: int) -> int:
    """Numbers that a pixel's equations consist of: the matrix's upper triangle, right side, square, count."""
    return bands * (bands + 1) // 2 + bands + 2


@compiled
def solve_full(
    equations: Array, prior: Array, volumes: Array, taus: Array, level: float, bounds: Array,
    parameters: float, share: float, work: tuple[Array, ...], nodes: Array, variance: Array, local: Array,
    at_bound: Array, tau: Array, misfit: Array, sound: Array,
) -> None:  # fmt: skip
    """Solve pixels (pixels, channels); those that are not ``sound`` have a system that is not definite.

    ``prior`` (4, bands) are the diagonals of squared second differences and of the level, ``volumes``
    (candidates, rows) the inverse pivots of each candidate's prior alone. ``bounds`` are the lowest and the
    highest reflectance, the tolerance, the penalty of a band held there and the rounds. Results are (pixels,
    bands): nodes, variance of band means, information of the data within two bands, which are held at a
    bound; and (pixels,): the chosen smoothness ``tau`` and reduced chi-square. Degrees of freedom are less
    ``parameters``, at most a ``share`` of the samples.
    """
    matrix, x, spread, product, stiff, stiff_right, inverse, candidates = work
    bands, wide = nodes.shape[1], volumes.shape[1]
    triangle = bands * (bands + 1) // 2
    for p in range(equations.shape[0]):
        own = equations[p]
        for j in range(bands):
            stiff[j], stiff_right[j], at_bound[p, j] = 0.0, 0.0, False
        best = taus[0]
        sound[p] = True
        for t in range(len(taus) + 1):
            best = taus[t] if t < len(taus) else math.exp(most_evident(candidates, taus))
            load(own, prior, 1.0 / (best * best), level, stiff, stiff_right, wide, matrix)
            evidence = eliminate(matrix, wide, volumes[min(t, len(taus) - 1)], inverse)
            if evidence == np.inf:
                sound[p] = False
                break
            if t < len(taus):
                candidates[t] = evidence
        tau[p] = best
        if not sound[p]:
            continue
        substitute(matrix, inverse, wide, x)
        spread_means(matrix, inverse, bands, wide, spread, variance[p])
        for _ in range(int(bounds[4])):
            if not pin(
                own, prior, 1.0 / (best * best), level, bounds, x, product, at_bound[p], stiff, stiff_right
            ):
                break
            load(own, prior, 1.0 / (best * best), level, stiff, stiff_right, wide, matrix)
            eliminate(matrix, wide, volumes[len(taus) - 1], inverse)
            substitute(matrix, inverse, wide, x)
        explained = 0.0
        for j in range(bands):
            x[j] = min(max(x[j], bounds[0]), bounds[1])
            nodes[p, j] = x[j]
        multiply(own, x, product, bands)
        for j in range(bands):
            explained += x[j] * (2.0 * own[triangle + j] - product[j])
        samples = own[triangle + bands + 1]
        freedom = max(samples - min(parameters, share * samples), 1.0)
        misfit[p] = (own[triangle + bands] - explained) / freedom
        near_diagonal(own, bands, local[p])


@within
def load(
    own: Array, prior: Array, weight: float, level: float, stiff: Array, stiff_right: Array, wide: int,
    matrix: Array,
) -> None:  # fmt: skip
    """Write data, prior and what holds bands at a bound into the ``matrix``, right side last.

    Rows that fill up the last panel have a one on the diagonal and reach nothing.
    """
    bands, row = prior.shape[1], (wide + PANEL) & MOST
    right = bands * (bands + 1) // 2
    begin = 0
    for j in range(bands):
        to, count = (j * (row + 1)) & MOST, (bands - j) & MOST
        for k in range(count):
            matrix[to + k] = own[begin + k]
        for k in range(count, (row - j) & MOST):
            matrix[to + k] = 0.0
        matrix[to] += prior[0, j] * weight + prior[3, j] + stiff[j]
        for o in range(1, min(3, bands - j)):
            matrix[to + o] += prior[o, j] * weight
        matrix[j * row + wide] = own[right + j] + level * prior[3, j] + stiff_right[j]
        begin = (begin + count) & MOST
    for j in range(bands, wide):
        for k in range(row):
            matrix[j * row + k] = 0.0
        matrix[j * (row + 1)] = 1.0


@within
def eliminate(matrix: Array, wide: int, volume: Array, inverse: Array) -> float:
    """Eliminate in place, and the ``inverse`` of the pivots; infinite where one is not positive.

    The evidence is the energy of the right side less the logarithm of the pivots' product, each of which its
    ``volume`` brings near one.
    """
    row = (wide + PANEL) & MOST
    evidence = 0.0
    for p in range(0, wide, PANEL):
        product = 1.0
        for r in range(p, p + PANEL):
            own = (r * row) & MOST
            pivot, z = matrix[own + r], matrix[own + wide]
            if not (pivot > 0.0 and pivot < np.inf):
                return math.inf
            inverse[r] = 1.0 / pivot
            product *= pivot * volume[r]
            evidence += z * z * inverse[r]
            for j in range(r + 1, p + PANEL):
                low, to = matrix[own + j] * inverse[r], (j * row) & MOST
                for k in range(p & MOST, row):
                    matrix[to + k] -= low * matrix[own + k]
        evidence -= math.log(product)
        take_panel(matrix, inverse, p, wide, matrix, row, -1)
    return evidence


@within
def take_panel(
    factor: Array, inverse: Array, p: int, wide: int, rows: Array, length: int, until: int
) -> None:
    """Take a panel's part out of all later ``rows``, from their diagonal on or ``until`` a column."""
    row = (wide + PANEL) & MOST
    a, b, c, d = (p * row) & MOST, ((p + 1) * row) & MOST, ((p + 2) * row) & MOST, ((p + 3) * row) & MOST
    e, f, g, h = a + 4 * row, b + 4 * row, c + 4 * row, d + 4 * row
    ra, n = (p * length) & MOST, length & MOST
    rb, rc, rd = ra + n, ra + 2 * n, ra + 3 * n
    re, rf, rg, rh = ra + 4 * n, ra + 5 * n, ra + 6 * n, ra + 7 * n
    for j in range(p + PANEL, wide):
        l0, l1 = factor[a + j] * inverse[p], factor[b + j] * inverse[p + 1]
        l2, l3 = factor[c + j] * inverse[p + 2], factor[d + j] * inverse[p + 3]
        l4, l5 = factor[e + j] * inverse[p + 4], factor[f + j] * inverse[p + 5]
        l6, l7 = factor[g + j] * inverse[p + 6], factor[h + j] * inverse[p + 7]
        to = (j * length) & MOST
        begin, end = ((j // PANEL * PANEL) & MOST, n) if until < 0 else (0, until & MOST)
        for k in range(begin, end):
            left = (l0 * rows[ra + k] + l1 * rows[rb + k]) + (l2 * rows[rc + k] + l3 * rows[rd + k])
            more = (l4 * rows[re + k] + l5 * rows[rf + k]) + (l6 * rows[rg + k] + l7 * rows[rh + k])
            rows[to + k] -= left + more


@within
def substitute(matrix: Array, inverse: Array, wide: int, x: Array) -> None:
    """The solution ``x`` (rows,) of an eliminated system."""
    row = wide + PANEL
    for j in range(wide - 1, -1, -1):
        own = j * row
        even, odd = matrix[own + wide], 0.0
        for k in range(j + 1, wide - 1, 2):
            even -= matrix[own + k] * x[k]
            odd += matrix[own + k + 1] * x[k + 1]
        if (wide - j) % 2 == 0:
            even -= matrix[own + wide - 1] * x[wide - 1]
        x[j] = (even - odd) * inverse[j]


@within
def spread_means(
    matrix: Array, inverse: Array, bands: int, wide: int, spread: Array, variance: Array
) -> None:
    """Variance of each band mean: ``|L^-1 w|^2`` of its weights of 1/6, 2/3 and 1/6; the ends are repeated.

    A row of ``spread`` has what is left at its band of the weights of each mean, once those before are
    eliminated.
    """
    row, length = (wide + PANEL) & MOST, wide & MOST
    for k in range(wide * length):
        spread[k] = 0.0
    for j in range(1, bands - 1):
        spread[(j - 1) * length + j] = 1.0 / 6.0
        spread[j * length + j] = 4.0 / 6.0
        spread[(j + 1) * length + j] = 1.0 / 6.0
    for k in range(bands):
        variance[k] = 0.0
    for p in range(0, wide, PANEL):
        # Means that reach the rows of the panel or those before.
        until = min(p + PANEL + 1, wide)
        for r in range(p, p + PANEL):
            own = (r * length) & MOST
            for j in range(r + 1, p + PANEL):
                low, to = matrix[r * row + j] * inverse[r], (j * length) & MOST
                for k in range(until & MOST):
                    spread[to + k] -= low * spread[own + k]
            for k in range(min(until, bands) & MOST):
                variance[k] += spread[own + k] * spread[own + k] * inverse[r]
        take_panel(matrix, inverse, p, wide, spread, length, until)
    variance[0], variance[bands - 1] = variance[1], variance[bands - 2]


@within
def pin(
    own: Array, prior: Array, weight: float, level: float, bounds: Array, x: Array, product: Array,
    held: Array, stiff: Array, stiff_right: Array,
) -> bool:  # fmt: skip
    """Choose the bands that are held at a bound next; False where none changes."""
    low, high, tolerance, penalty = bounds[0], bounds[1], bounds[2], bounds[3]
    bands = prior.shape[1]
    outside = False
    for j in range(bands):
        outside |= held[j] or x[j] < low - tolerance or x[j] > high + tolerance
    if not outside:
        return False
    multiply(own, x, product, bands)
    right = bands * (bands + 1) // 2
    changed = False
    begin = 0
    for j in range(bands):
        slope = product[j] + (prior[0, j] * weight + prior[3, j]) * x[j]
        for o in range(1, 3):
            if j + o < bands:
                slope += prior[o, j] * weight * x[j + o]
            if j >= o:
                slope += prior[o, j - o] * weight * x[j - o]
        slope -= own[right + j] + level * prior[3, j]
        at_low = x[j] < 0.5 * (low + high)
        stays = held[j] and not (slope < 0.0 if at_low else slope > 0.0)
        holds = stays or x[j] < low - tolerance or x[j] > high + tolerance
        changed |= holds != held[j]
        held[j] = holds
        stiff[j] = penalty * (own[begin] + prior[0, j] * weight + prior[3, j]) if holds else 0.0
        stiff_right[j] = stiff[j] * (low if at_low else high)
        begin += bands - j
    return changed


@within
def multiply(own: Array, x: Array, product: Array, bands: int) -> None:
    """Product of the data's matrix with ``x`` (bands,)."""
    for j in range(bands):
        product[j] = 0.0
    begin = 0
    for j in range(bands):
        total, here, at = own[begin] * x[j], x[j], (begin - j) & MOST
        for k in range((j + 1) & MOST, bands & MOST):
            product[k] += own[at + k] * here
        for k in range(j + 1, bands):
            total += own[begin - j + k] * x[k]
        product[j] += total
        begin += bands - j


@within
def near_diagonal(own: Array, bands: int, local: Array) -> None:
    """Information of the data on a common change of the bands within two of each, ``local`` (bands,)."""
    for j in range(bands):
        local[j] = 0.0
    begin = 0
    for j in range(bands):
        local[j] += own[begin]
        for o in range(1, min(3, bands - j)):
            local[j] += own[begin + o]
            local[j + o] += own[begin + o]
        begin += bands - j


@within
def most_evident(candidates: Array, taus: Array) -> float:
    """Logarithm of the smoothness at the peak of a parabola through the best candidate and its neighbours.

    As in `lane_kernels`, for one pixel: compiled functions that call each other are in one module.
    """
    best = 0
    for t in range(len(taus)):
        if candidates[t] > candidates[best]:
            best = t
    best = min(max(best, 1), len(taus) - 2)
    left, middle, right = candidates[best - 1], candidates[best], candidates[best + 1]
    curvature = 2.0 * middle - left - right
    shift = 1.0 if right > left else (-1.0 if right < left else 0.0)
    if curvature > 0.0:
        shift = min(max(0.5 * (right - left) / max(curvature, 1e-6), -1.0), 1.0)
    place: float = math.log(taus[best]) + shift * (math.log(taus[1]) - math.log(taus[0]))
    return place
