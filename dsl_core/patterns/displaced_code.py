"""Whether a part of a binary code was shown displaced, by the columns that it then never names.

Displaced from some pair on, a code names columns that fit each other, but those of a place next to their own.
That shows only at edges of the stripes before: on one side, as many columns are named by no pixel as the
picture was displaced by, and as many on the other by twice as many. This needs neither the rows of a code nor
a calibration.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.plan import BinaryCode
from dsl_core.patterns.binary_code import binary_image, decoder_of
from dsl_core.patterns.gray_code import bit_counts
from dsl_core.solve.normal import STD_OF_MEDIAN_SIZE

#: Columns by which pictures may be displaced, to either side; wider ones leave traces elsewhere as well.
MOST_COLUMNS = 4
#: Pixels that the columns in question should have, judged by those next to them.
FEWEST_PIXELS = 16.0
#: Shares of these from which on columns are named, and up to which they are named once.
NAMED, ONCE = 0.3, 1.25
#: Columns on either side that say how many pixels there are in one.
NEAR = 2
#: A picture that skips more than this share of columns may skip the same ones in all rows: so many edges have
#: to agree, or several to differ by so many deviations of columns elsewhere, which are so far from them.
MOST_SKIPPED, FEWEST_EDGES, SIGMAS = 0.2, 20.0, 4.0
#: Where this share of neighbouring pixels is the same number of columns apart, two or more, all edges agree
#: anyway: only deviations count then. So it is where this share of pixels so many apart is 16, 32, 48...
#: columns apart, as edges are: at pixels 4/3 of a column wide, each is at the same place between them.
REGULAR, REPEATED, APART = 0.9, 0.95, (12, 20, 28)
#: Columns elsewhere: those in one row are alike if pixels are 2, 4 or 8 columns apart.
ELSEWHERE = np.array([[side * away for away in range(6 + k, 30, 4) for side in (-1, 1)] for k in range(4)])
#: Pixels side by side whose columns are further apart are on different surfaces.
STEP_PX = 20


@dataclass(frozen=True)
class DisplacedCode:
    """Pairs ``since_pair`` and later are displaced by so many ``columns``; positive towards higher ones."""

    columns: int
    since_pair: int


def displaced_code(
    code: BinaryCode, size_px: tuple[int, int], column: NDArray[np.integer]
) -> DisplacedCode | None:
    """What was displaced of a code, from the columns that it names at pixels; None if nothing was.

    ``column`` (rows, columns) is -1 where it is not known for certain; ``size_px`` is the projector's
    (width, height). Narrow ones tell nothing. Raises `PlanError`.
    """
    if size_px[0] <= 4 * MOST_COLUMNS:
        return None
    named = np.bincount(column[column >= 0], minlength=size_px[0])[: size_px[0]].astype(np.float64)
    tried, times = _tried(code, size_px)
    is_never, is_once, is_twice = times == 0, times == 1, times >= 2
    never, twice = is_never @ named, is_twice @ named
    # Columns that are named once say how many pixels a column has: on both sides, as surfaces end anywhere.
    sides = [_mean(is_once & _near(side), named) for side in (is_never, is_twice)]
    # Between fine stripes there are none, nor are there in each row of a coarse picture: all together then.
    is_fine = 2 * (is_once & _near(is_never)).sum(1) < is_never.sum(1)
    skips = _skipped(column) > MOST_SKIPPED
    all_together = _mean(is_never | is_twice | (is_once & _near(is_never | is_twice)), named)
    least, most = (np.where(is_fine | skips, all_together, of(*sides)) for of in (np.minimum, np.maximum))
    expected = least * is_never.sum(1)
    told = (expected >= FEWEST_PIXELS) & (never < NAMED * expected)
    told &= twice > ONCE * most * is_twice.sum(1)
    if skips:
        edges = is_twice @ (named > 0).astype(np.float64) / [abs(one.columns) for one in tried]
        deviations = _deviations(named, is_never, is_twice)
        told &= ((edges >= FEWEST_EDGES) & (not _is_regular(column))) | ((edges > 1) & (deviations > SIGMAS))
    if not told.any():
        return None
    return tried[int(np.where(told, expected - never, -1).argmax())]


def _skipped(column: NDArray[np.integer]) -> float:
    """Share of the columns that a picture sees which it skips from pixel to pixel."""
    times = _steps(column, 1)
    moves = int(times[1:].sum())
    return 1.0 - moves / float(times @ np.arange(times.size)) if moves else 1.0


def _is_regular(column: NDArray[np.integer]) -> bool:
    """Whether pixels see columns at the same places of all stripes."""
    next_ones = _steps(column, 1)
    if next_ones[2:].max() > REGULAR * next_ones.sum():
        return True
    alike = ((_steps(column, apart), apart // 16 * 16 + 16) for apart in APART)
    return any(times[more::16].max() > REPEATED * times.sum() for times, more in alike)


def _steps(column: NDArray[np.integer], apart: int) -> NDArray[np.int64]:
    """How many pixels so many apart in a row are 0, 1, 2... columns apart."""
    left, right = column[:, :-apart], column[:, apart:]
    steps = np.abs(right - left)[(left >= 0) & (right >= 0)]
    most = STEP_PX * apart
    return np.bincount(steps[steps <= most], minlength=most + 1)


def _deviations(
    named: NDArray[np.float64], never: NDArray[np.bool_], twice: NDArray[np.bool_]
) -> NDArray[np.float64]:
    """By how much columns ``twice`` exceed those ``never`` (tried, width), in deviations of other columns."""
    moved = np.stack([np.roll(named, -away) for away in (0, *ELSEWHERE.flat)], 1)
    one, other = (columns @ moved / columns.sum(1, keepdims=True).clip(1) for columns in (never, twice))
    total = one + other
    # Columns that no pixel sees are no sign that columns are alike.
    apart = np.divide(other - one, total, out=np.ones_like(total), where=total > 0)
    # The median, as edges of the next stripes may be among those elsewhere.
    usual = STD_OF_MEDIAN_SIZE * np.median(np.abs(apart[:, 1:]).reshape(-1, *ELSEWHERE.shape), 2).max(1)
    return np.asarray(apart[:, 0] / usual.clip(1e-9))


@lru_cache(maxsize=8)
def _tried(code: BinaryCode, size_px: tuple[int, int]) -> tuple[tuple[DisplacedCode, ...], NDArray[np.int64]]:
    """Displacements that are tried, and how often each of them makes the code name each column.

    The latter has shape (tried, width). Columns near both ends, which some displacements lose, count as named
    once and say nothing.
    """
    width, bits = size_px[0], sum(bit_counts(code, size_px))
    pairs = bits * (2 if code.kind == "ensemble" else 1)
    lines = [binary_image(code, size_px, 2 * pair)[0] > 0 for pair in range(pairs)]
    varied = [pair for pair, line in enumerate(lines) if (line != line[0]).any()]
    sides = [side for size in range(1, MOST_COLUMNS + 1) for side in (size, -size)]
    tried = tuple(DisplacedCode(side, since) for side in sides for since in varied[1:])
    decoder = decoder_of(code, size_px)
    for pair, line in enumerate(lines):
        light = np.stack([np.roll(line, each.columns if pair >= each.since_pair else 0) for each in tried])
        decoder.add(light, ~light)
    times = np.ones((len(tried), width), np.int64)
    inside = slice(2 * MOST_COLUMNS, width - 2 * MOST_COLUMNS)
    shown = decoder.finish().column[:, MOST_COLUMNS : width - MOST_COLUMNS]  # what was rolled in is not
    for count, column in zip(times, shown, strict=True):
        count[inside] = np.bincount(column[column >= 0], minlength=width)[inside]
    times.flags.writeable = False
    return tried, times


def _mean(columns: NDArray[np.bool_], named: NDArray[np.float64]) -> NDArray[np.float64]:
    """Pixels that a column has on average, of the columns in each row (tried, width)."""
    return np.asarray(columns @ named / columns.sum(1).clip(1))


def _near(columns: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Columns up to `NEAR` from those given, of each row."""
    found = np.zeros_like(columns)
    for step in range(1, NEAR + 1):
        found[:, step:] |= columns[:, :-step]
        found[:, :-step] |= columns[:, step:]
    return found
