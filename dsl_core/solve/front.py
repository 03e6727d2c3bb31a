"""What none beats in both cost and error."""

from __future__ import annotations

from collections.abc import Sequence


def front(points: Sequence[tuple[float, float]]) -> list[int]:
    """Indices of points (cost, error) that no other beats in both, from cheap to dear.

    >>> front([(1.0, 3.0), (2.0, 4.0), (5.0, 1.0)])
    [0, 2]
    """
    order = sorted(range(len(points)), key=lambda i: points[i])
    kept: list[int] = []
    for i in order:
        if not kept or points[i][1] < points[kept[-1]][1]:
            kept.append(i)
    return kept
