"""The grid that points come from: its mesh, and an order that leaves no holes."""

from __future__ import annotations

import numpy as np
import pytest
from dsl_app.results.cloud.look import Grid


def _plane(rows: int, columns: int) -> tuple[np.ndarray[tuple[int, ...], np.dtype[np.float32]], Grid]:
    y, x = np.mgrid[:rows, :columns].astype(np.float32)
    points = np.stack([x, y, np.full_like(x, 700)]).reshape(3, -1).T
    return np.ascontiguousarray(points), Grid((rows, columns), np.arange(rows * columns))


@pytest.mark.parametrize("share", [4, 2])
def test_the_first_points_are_evenly_spread(share: int) -> None:
    _, grid = _plane(32, 48)
    first = grid.even_order()[: 32 * 48 // share]
    taken = np.zeros((32, 48), int)
    taken.ravel()[first] = 1
    in_tiles = taken.reshape(16, 2, 24, 2).sum((1, 3))
    assert (in_tiles == 4 // share).all()
    assert sorted(grid.even_order()) == list(range(32 * 48))


def test_a_mesh_has_vertices_among_the_points() -> None:
    points, grid = _plane(6, 8)
    flat = grid.flat[grid.flat != 3 * 8 + 3]
    holed = Grid((6, 8), flat, normals=np.full((3, 6, 8), np.nan, np.float32))
    vertices, triangles = holed.mesh(points[flat], 1)
    assert len(vertices) == 47
    assert len(triangles) == 2 * 5 * 7 - 4
    np.testing.assert_array_equal(points[flat][vertices][triangles.max()], [7, 5, 700])
    normals = holed.normals_at(vertices)
    assert normals is not None
    np.testing.assert_array_equal(normals, [[0, 0, -1]] * 47)
