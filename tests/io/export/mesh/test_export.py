"""Meshes are opened by readers that nobody here wrote, and have the size and colours of the result."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dsl_core.errors import StoreError
from dsl_core.io.export.mesh.export import ENDINGS, export_mesh, mesh_files
from tests.cases.small_result import COLUMNS, ROWS, UNLIT, small_result

#: Of two missing pixels, the one at the rim takes a triangle of each of two squares, the one in a corner one.
TRIANGLES = 2 * (ROWS - 1) * (COLUMNS - 1) - 2 - 1


def _expected_mm() -> np.ndarray[Any, Any]:
    points = small_result()["points_mm"].values.reshape(3, -1).T
    return np.asarray(points[np.isfinite(points).all(1)])


@pytest.mark.parametrize("ending", ENDINGS)
def test_trimesh_reads_the_surface_in_the_unit_of_its_format(tmp_path: Path, ending: str) -> None:
    trimesh = pytest.importorskip("trimesh")
    path = tmp_path / f"my scan{ending}"
    files = export_mesh(small_result(), path)
    assert files == mesh_files(path, has_colour=True)
    mesh = trimesh.load_mesh(path, process=False)
    assert len(mesh.faces) == TRIANGLES
    found, expected = mesh.vertices, _expected_mm()
    if ending == ".glb":
        found = found * [1000, -1000, -1000]
    np.testing.assert_allclose(np.sort(found, 0)[[0, -1]], np.sort(expected, 0)[[0, -1]], atol=2e-3)
    if ending != ".stl":
        np.testing.assert_allclose(found, expected, atol=2e-3)
        to_camera = mesh.face_normals[:, 2] * (1 if ending == ".glb" else -1)
        assert (to_camera > 0).all()


@pytest.mark.parametrize("ending", [".obj", ".ply", ".stl"])
def test_meshio_reads_the_triangles(tmp_path: Path, ending: str) -> None:
    meshio = pytest.importorskip("meshio")
    path, *_ = export_mesh(small_result(), tmp_path / f"x{ending}")
    mesh = meshio.read(path)
    assert len(mesh.get_cells_type("triangle")) == TRIANGLES
    corners = mesh.points[mesh.get_cells_type("triangle")]
    assert (np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, 2] < 0).all()
    if ending == ".ply":
        lit = np.isfinite(small_result()["depth_mm"].values)
        np.testing.assert_array_equal(
            mesh.point_data["scalar_550nm"], small_result()["reflectance"].values[2, lit]
        )


@pytest.mark.parametrize("ending", ENDINGS)
def test_vtk_reads_the_triangles(tmp_path: Path, ending: str) -> None:
    from vtkmodules.vtkIOGeometry import vtkGLTFReader, vtkOBJReader, vtkSTLReader
    from vtkmodules.vtkIOPLY import vtkPLYReader

    path, *_ = export_mesh(small_result(), tmp_path / f"x{ending}")
    readers: dict[str, Any] = {
        ".glb": vtkGLTFReader,
        ".obj": vtkOBJReader,
        ".ply": vtkPLYReader,
        ".stl": vtkSTLReader,
    }
    reader = readers[ending]()
    reader.SetFileName(str(path))
    reader.Update()
    mesh = reader.GetOutput()
    while not mesh.IsA("vtkPolyData"):
        mesh = mesh.GetBlock(0)
    assert mesh.GetNumberOfPolys() == TRIANGLES
    low_z, high_z = mesh.GetBounds()[4:]
    depth = small_result()["depth_mm"].values
    low, high = np.nanmin(depth), np.nanmax(depth)
    expected = (-high / 1000, -low / 1000) if ending == ".glb" else (low, high)
    assert (low_z, high_z) == pytest.approx(expected)


@pytest.mark.parametrize("ending", [".glb", ".obj"])
def test_a_vertex_has_the_colour_of_its_pixel(tmp_path: Path, ending: str) -> None:
    trimesh = pytest.importorskip("trimesh")
    export_mesh(small_result(), path := tmp_path / f"my scan{ending}")
    mesh = trimesh.load_mesh(path, process=False)
    rgb = small_result()["rgb"].values[:, np.isfinite(small_result()["depth_mm"].values)].T
    np.testing.assert_allclose(mesh.visual.to_color().vertex_colors[:, :3], rgb * 255, atol=1.5)


def test_a_hole_does_not_darken_its_neighbours(tmp_path: Path) -> None:
    from PIL import Image

    _, _, texture = export_mesh(small_result(), tmp_path / "x.obj")
    colours = np.asarray(Image.open(texture))
    y, x = UNLIT
    around = [tuple(colours[place]) for place in ((y, x - 1), (y, x + 1), (y + 1, x))]
    assert tuple(colours[UNLIT]) in around


def test_glb_is_one_file_that_names_its_scan(tmp_path: Path) -> None:
    import json

    (path,) = export_mesh(small_result(), tmp_path / "x.glb")
    content = path.read_bytes()
    magic, version, size = struct.unpack_from("<4sII", content)
    assert (magic, version, size) == (b"glTF", 2, len(content))
    length = struct.unpack_from("<I", content, 12)[0]
    assert length % 4 == 0
    described = json.loads(content[20 : 20 + length])
    assert described["asset"]["extras"]["scan_id"] == "2026-05-04-chart"
    assert all("uri" not in image for image in described["images"])


def test_each_second_pixel_makes_a_quarter_of_the_triangles(tmp_path: Path) -> None:
    trimesh = pytest.importorskip("trimesh")
    export_mesh(small_result(), path := tmp_path / "x.stl", every=2)
    assert len(trimesh.load_mesh(path).faces) == 2 * 2 * 4


@pytest.mark.parametrize("ending", ENDINGS)
def test_without_colour_the_shape_is_written(tmp_path: Path, ending: str) -> None:
    trimesh = pytest.importorskip("trimesh")
    result = small_result()[["points_mm", "depth_mm"]]
    assert export_mesh(result, path := tmp_path / f"x{ending}") == [path]
    assert len(trimesh.load_mesh(path, process=False).faces) == TRIANGLES


def test_a_surface_of_nothing_is_refused_in_one_sentence(tmp_path: Path) -> None:
    result = small_result()
    result["points_mm"][:] = np.nan
    with pytest.raises(StoreError, match="No two neighbouring pixels"):
        export_mesh(result, tmp_path / "x.glb")
    with pytest.raises(StoreError, match="step of 4 pixels"):
        export_mesh(small_result(), tmp_path / "x.glb", every=4)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("part", [{"y": [3]}, {"x": [3]}, {"x": [3], "y": [3]}])
def test_a_row_or_column_of_pixels_is_told_to_be_no_surface(
    tmp_path: Path, part: dict[str, list[int]]
) -> None:
    result = small_result().isel(part)
    size = f"{result.sizes['x']} x {result.sizes['y']}"
    with pytest.raises(
        StoreError, match=f"needs two rows and two columns of pixels, and this result is {size}"
    ):
        export_mesh(result, tmp_path / "x.glb")
