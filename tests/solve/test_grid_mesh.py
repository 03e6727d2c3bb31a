"""Triangles join what is one surface, and nothing else."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dsl_core.solve.grid_mesh import mesh_of_grid, normals_of


def _points(depth: NDArray[np.float64], focal_px: float = 400.0) -> NDArray[np.float64]:
    """Points of a pinhole camera (3, rows, columns)."""
    y, x = np.mgrid[: depth.shape[0], : depth.shape[1]]
    return np.stack([(x - 20) / focal_px * depth, (y - 15) / focal_px * depth, depth])


def test_a_plane_becomes_all_triangles_that_face_the_camera() -> None:
    points = _points(np.full((30, 40), 700.0))
    mesh = mesh_of_grid(points)
    assert len(mesh.triangles) == 2 * 29 * 39
    np.testing.assert_array_equal(mesh.pixels, np.arange(1200))
    vertices = points.reshape(3, -1).T[mesh.pixels]
    a, b, c = (vertices[mesh.triangles[:, corner]] for corner in range(3))
    areas = np.cross(b - a, c - a)
    assert (areas[:, 2] < 0).all()
    np.testing.assert_allclose(np.linalg.norm(areas, axis=1).sum() / 2, 29 * 39 * (700 / 400) ** 2)
    np.testing.assert_allclose(normals_of(vertices, mesh.triangles), [[0, 0, -1]] * 1200, atol=1e-6)


def test_a_jump_is_cut_and_a_steep_slope_is_not() -> None:
    x = np.arange(40.0)
    jump = np.broadcast_to(np.where(x < 20, 700.0, 720.0), (30, 40))
    mesh = mesh_of_grid(_points(jump))
    assert len(mesh.triangles) == 2 * 29 * 38
    # Pixels are 1.75 mm apart; 5 mm from one to the next is a slope of 70 degrees.
    slope = np.broadcast_to(700.0 + 5 * x, (30, 40))
    assert len(mesh_of_grid(_points(slope)).triangles) == 2 * 29 * 39


def test_a_step_that_noise_might_be_is_cut_from_a_hundredth_of_the_distance_on() -> None:
    deviation = np.full((30, 40), 5.0)
    for step_mm, columns in ((6.5, 39), (8.0, 38)):
        depth = np.where(np.arange(40) < 20, 700.0, 700.0 + step_mm) * np.ones((30, 1))
        mesh = mesh_of_grid(_points(depth, focal_px=4000.0), deviation)
        assert len(mesh.triangles) == 2 * 29 * columns


def test_noise_does_not_cut_but_a_flagged_step_does() -> None:
    rng = np.random.default_rng(3)
    depth = 700 + rng.normal(0, 2.0, (30, 40))
    fine = _points(depth, focal_px=4000.0)
    assert len(mesh_of_grid(fine, np.full((30, 40), 2.0)).triangles) > 0.9 * 2 * 29 * 39
    assert len(mesh_of_grid(fine).triangles) < 0.3 * 2 * 29 * 39, "without a deviation every step is real"
    small = np.where(np.arange(40) < 20, 700.0, 704.0) * np.ones((30, 1))
    edge = np.zeros((30, 40), bool)
    assert len(mesh_of_grid(_points(small)).triangles) == 2 * 29 * 39
    edge[:, 19:21] = True
    assert len(mesh_of_grid(_points(small), edge=edge).triangles) == 2 * 29 * 38
    assert len(mesh_of_grid(_points(small), edge=edge, every=2).triangles) == 2 * 14 * 18


def test_a_hole_takes_only_the_corners_that_are_missing() -> None:
    depth = np.full((30, 40), 700.0)
    depth[10, 10] = np.nan
    mesh = mesh_of_grid(_points(depth))
    # Each of the four squares around the hole keeps the triangle of its three other corners.
    assert len(mesh.triangles) == 2 * 29 * 39 - 4
    assert 10 * 40 + 10 not in mesh.pixels


def test_nothing_makes_an_empty_mesh() -> None:
    mesh = mesh_of_grid(np.full((3, 5, 6), np.nan))
    assert mesh.pixels.size == 0
    assert mesh.triangles.shape == (0, 3)


def test_a_square_is_split_where_more_of_it_is_joined_even_if_the_other_way_is_flatter() -> None:
    # From corner to corner 3 mm one way, which is a flagged jump, and 3.2 mm the other way.
    points = _points(np.array([[700.0, 698.4], [701.6, 703.0]]))
    edge = np.array([[True, False], [False, True]])
    mesh = mesh_of_grid(points, edge=edge)
    assert sorted(map(sorted, mesh.triangles.tolist())) == [[0, 1, 2], [1, 2, 3]]
    assert len(mesh_of_grid(points).triangles) == 2


def test_a_square_whose_corners_are_all_joined_is_split_along_the_flatter_diagonal() -> None:
    raised = np.array([[700.0, 700.6], [700.0, 700.0]])
    along = mesh_of_grid(_points(raised)), mesh_of_grid(_points(raised[:, ::-1]))
    falling, rising = ([sorted(each) for each in mesh.triangles.tolist()] for mesh in along)
    assert (sorted(falling), sorted(rising)) == ([[0, 1, 3], [0, 2, 3]], [[0, 1, 2], [1, 2, 3]])
