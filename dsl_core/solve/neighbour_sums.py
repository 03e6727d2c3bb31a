"""Equations of pixels from those of the samples around them, as compiled code."""

from __future__ import annotations

from typing import Any

from dsl_core.solve.compiled import compiled, within

Array = Any


@compiled
def gather(
    equations: Array, neighbours: bool, shares: Array, shading: Array, matrix: int, right: int,
    gathered: Array,
) -> None:  # fmt: skip
    """Equations of a grid of pixels, ``gathered`` (rows, columns, channels), from those of their samples.

    With ``neighbours`` the ``equations`` have one more sample on every side, of which pixels take ``shares``
    (rows, 8, columns), in the order of `dsl_core.optics.colour_neighbours.AROUND`. The first channels are
    those of the ``matrix``, the next of the ``right`` side, both for unit reflectance: they are multiplied by
    the ``shading`` (rows, columns).
    """
    for y in range(gathered.shape[0]):
        for x in range(gathered.shape[1]):
            if neighbours:
                left, beside, above, below = (
                    shares[y, 0, x],
                    shares[y, 1, x],
                    shares[y, 2, x],
                    shares[y, 3, x],
                )
                for c in range(gathered.shape[2]):
                    total = equations[y + 1, x + 1, c] + left * equations[y + 1, x, c]
                    total += beside * equations[y + 1, x + 2, c]
                    total += above * equations[y, x + 1, c]
                    gathered[y, x, c] = total + below * equations[y + 2, x + 1, c]
                corners = shares[y, 4, x], shares[y, 5, x], shares[y, 6, x], shares[y, 7, x]
                if corners[0] + corners[1] + corners[2] + corners[3] > 0.0:
                    add_corners(equations, x, y, corners, gathered)
            else:
                for c in range(gathered.shape[2]):
                    gathered[y, x, c] = equations[y, x, c]
            for c in range(matrix + right):
                gathered[y, x, c] *= shading[y, x]
            for c in range(matrix):
                gathered[y, x, c] *= shading[y, x]


@within
def add_corners(
    equations: Array, x: int, y: int, shares: tuple[float, float, float, float], gathered: Array
) -> None:
    """Add the samples at a pixel's corners to its equations."""
    # A loop of its own: with more arrays it could not be found out before whether they overlap.
    a, b, c, d = shares
    for k in range(gathered.shape[2]):
        total = a * equations[y, x, k] + b * equations[y, x + 2, k]
        gathered[y, x, k] += total + c * equations[y + 2, x, k] + d * equations[y + 2, x + 2, k]
