"""Pictures that do not fit their set: a digit that is lost, a pair that is none, one that is shown twice."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from dsl_core.patterns.recognition.probes import Lines
from dsl_core.patterns.recognition.stripe_sets import StripeReading, pairs_of

#: Each digit of Gray and binary code has twice the edges of the one before it; more is a digit lost between.
MOST_FINER = 3.0
#: Edges of so many stripes in a line, and stripes this far from grey, can be counted.
EDGES_A_LINE, CLEAR = 4.0, 0.15
#: A clear picture and its inverse go against each other by more than this share.
AGAINST = -0.3
#: Pictures one after the other that go together like this show the same.
SAME = 0.97


def lost_after(
    lines: Lines, pictures: Sequence[int | None], reading: StripeReading
) -> tuple[int, int] | None:
    """The pictures between which that of a digit is lost: stripes become four times finer; else None.

    ``pictures`` are those of the reading, in their order.
    """
    if reading.code == "xor":
        return None
    digits = list(pictures)
    if reading.inverse != "none":
        digits = [one if one is not None else other for one, other in pairs_of(pictures, reading.inverse)]
    digits = digits if reading.first == "most" else digits[::-1]
    for coarse, fine in pairwise(digits):
        if coarse is None or fine is None:
            continue
        edges = _edges(lines, coarse)
        countable = edges >= EDGES_A_LINE * len(lines.lit) and _clearness(lines, fine) > CLEAR
        if countable and _edges(lines, fine) > MOST_FINER * edges:
            return coarse, fine
    return None


def odd_pairs(lines: Lines, pictures: Sequence[int | None], reading: StripeReading) -> list[tuple[int, int]]:
    """Clear pictures and what should be their inverses that do not go against each other."""
    if reading.inverse == "none":
        return []
    both = pairs_of(pictures, reading.inverse)
    return odd_among(lines, [(one, other) for one, other in both if one is not None and other is not None])


def odd_among(lines: Lines, pairs: Sequence[tuple[int, int]]) -> list[tuple[int, int]]:
    """Those of some pairs that are clear and do not go against each other."""
    found = []
    for one, other in pairs:
        a, b = lines.of(one) - 0.5, lines.of(other) - 0.5
        if min(np.abs(a).mean(), np.abs(b).mean()) < CLEAR:
            continue
        if float(np.mean(a * b)) > AGAINST * float(np.mean(a * a) + np.mean(b * b)) / 2:
            found.append((one, other))
    return found


def same_in_a_row(lines: Lines) -> list[tuple[int, int]]:
    """Pictures one after the other that show the same stripes, which no capture does on purpose."""
    values = lines.some(range(len(lines.values))).astype(np.float64)
    found = []
    for k, (one, other) in enumerate(pairwise(values)):
        # White, black and what nobody sees do not vary.
        if min(one.std(), other.std()) > CLEAR and np.corrcoef(one, other)[0, 1] > SAME:
            found.append((k, k + 1))
    return found


def _edges(lines: Lines, picture: int) -> int:
    bright = lines.values[picture] > 0.5
    return int(((bright[:, 1:] != bright[:, :-1]) & lines.pairs).sum())


def _clearness(lines: Lines, picture: int) -> float:
    return float(np.abs(lines.of(picture) - 0.5).mean())
