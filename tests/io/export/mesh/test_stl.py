"""The bytes of a binary STL file."""

from __future__ import annotations

import struct

import numpy as np
import pytest

from dsl_core.io.export.mesh.stl import stl_bytes
from dsl_core.io.export.mesh.surface import Surface


def test_triangles_have_unit_normals_to_the_right_of_their_course() -> None:
    points = np.array([[0, 0, 0], [3, 0, 0], [0, 2, 0], [0, 0, 5]], np.float32)
    triangles = np.array([[0, 1, 2], [0, 2, 3], [1, 1, 2]], np.int32)
    made = stl_bytes(Surface(points, points, points[:, :2], triangles, None), "a scan " * 20)
    assert len(made) == 84 + 3 * 50
    assert made[:32] == b"binary STL, unit mm, a scan a sc"
    assert struct.unpack_from("<I", made, 80) == (3,)
    found = [struct.unpack_from("<12fH", made, 84 + 50 * k) for k in range(3)]
    assert [each[:3] for each in found] == [(0, 0, 1), (1, 0, 0), (0, 0, 0)]
    assert [each[12] for each in found] == [0, 0, 0]
    assert np.array([each[3:12] for each in found]).reshape(3, 3, 3) == pytest.approx(points[triangles])


def test_a_slanted_triangle_has_the_normal_of_its_plane() -> None:
    points = np.array([[1, 1, 1], [4, 1, 2], [2, 3, 1]], np.float32)
    made = stl_bytes(Surface(points, points, points[:, :2], np.array([[0, 1, 2]], np.int32), None), "µ")
    normal = np.cross(points[1] - points[0], points[2] - points[0])
    assert struct.unpack_from("<3f", made, 84) == pytest.approx(normal / np.linalg.norm(normal))
    assert made[:80] == b"binary STL, unit mm, ?".ljust(80)


def test_triangles_of_any_size_have_unit_normals() -> None:
    points = 0.2 * np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32)
    made = stl_bytes(Surface(points, points, points[:, :2], np.array([[0, 1, 2]], np.int32), None), "")
    assert struct.unpack_from("<3f", made, 84) == pytest.approx((0, 0, 1))
