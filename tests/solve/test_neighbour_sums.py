"""Equations of pixels from those of samples around them, uncompiled, against sums one by one."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.optics.colour_neighbours import AROUND
from tests.solve.plain import plain

gather = plain("dsl_core.solve.neighbour_sums").gather
ROWS, COLUMNS, MATRIX, RIGHT, OTHERS = 2, 3, 4, 2, 2


@pytest.mark.parametrize("neighbours", [False, True])
def test_matrix_has_the_shading_twice_the_right_side_once_and_the_rest_not(neighbours: bool) -> None:
    rng = np.random.default_rng(3)
    margin = 2 * neighbours
    equations = rng.normal(size=(ROWS + margin, COLUMNS + margin, MATRIX + RIGHT + OTHERS))
    shares, shading = rng.uniform(0, 1, (ROWS, 8, COLUMNS)), rng.uniform(0.5, 1.5, (ROWS, COLUMNS))
    shares[0, 4:, 1] = 0.0  # a green pixel has no samples at its corners
    found = np.full((ROWS, COLUMNS, MATRIX + RIGHT + OTHERS), np.nan)
    gather(equations, neighbours, shares, shading, MATRIX, RIGHT, found)
    powers = np.array([2] * MATRIX + [1] * RIGHT + [0] * OTHERS)
    for y, x in np.ndindex(ROWS, COLUMNS):
        wanted = equations[y + neighbours, x + neighbours].copy()
        for share, (dy, dx) in zip(shares[y, :, x], AROUND, strict=True):
            if neighbours:
                wanted += share * equations[y + 1 + dy, x + 1 + dx]
        assert found[y, x] == pytest.approx(wanted * shading[y, x] ** powers)
