"""The lines of an OBJ file and of its material."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pytest

from dsl_core.errors import Cancelled
from dsl_core.io.export.mesh.obj import _slices, material_files, material_text, write_obj
from dsl_core.io.export.mesh.surface import Surface

POINTS = np.array([[0, 0, 1], [1.5, 0, 1], [0, 2.25, 1]], np.float32)
NORMALS = np.array([[0, 0, -1], [0, 0.6, -0.8], [0, 0, -1]], np.float32)
PLACES = np.array([[0.25, 0.125], [0.75, 0.125], [0.25, 0.5]], np.float32)
SURFACE = Surface(POINTS, NORMALS, PLACES, np.array([[0, 2, 1]], np.int32), None)


def written(material: str, surface: Surface = SURFACE) -> list[str]:
    file = io.StringIO()
    write_obj(file, surface, material, {"rig": "twin  µ\nrig", "plan": "x" * 300}, lambda: None)
    return file.getvalue().splitlines()


def test_a_surface_with_a_texture_counts_from_one_and_from_the_lower_left() -> None:
    assert written("scan.mtl") == [
        "# unit mm, camera frame: x right, y down, z forward",
        "# rig: twin u rig",
        f"# plan: {'x' * 200}",
        "mtllib scan.mtl",
        "usemtl surface",
        "v 0.00000 0.00000 1.00000",
        "v 1.50000 0.00000 1.00000",
        "v 0.00000 2.25000 1.00000",
        "vt 0.250000 0.875000",
        "vt 0.750000 0.875000",
        "vt 0.250000 0.500000",
        "vn 0.0000 0.0000 -1.0000",
        "vn 0.0000 0.6000 -0.8000",
        "vn 0.0000 0.0000 -1.0000",
        "f 1/1/1 3/3/3 2/2/2",
    ]


def test_without_a_texture_faces_name_points_and_normals_alone() -> None:
    lines = written("")
    assert not [line for line in lines if line.startswith(("vt", "mtllib", "usemtl"))]
    assert lines[-1] == "f 1//1 3//3 2//2"
    assert SURFACE.places[0, 1] == 0.125, "the surface stays as it was"


def test_writing_asks_between_slices_whether_to_go_on() -> None:
    asked = []
    write_obj(io.StringIO(), SURFACE, "scan.mtl", {}, lambda: asked.append(1))
    assert len(asked) == 4, "points, places, normals, triangles"

    def stop() -> None:
        raise Cancelled("stopped")

    with pytest.raises(Cancelled):
        write_obj(io.StringIO(), SURFACE, "", {}, stop)
    assert [(part.start, part.stop) for part in _slices(40_001)] == [
        (0, 20_000), (20_000, 40_000), (40_000, 60_000),
    ]  # fmt: skip
    assert len(list(_slices(40_000))) == 2


def test_files_of_the_material_have_names_without_spaces() -> None:
    assert material_files(Path("a/my new scan.obj")) == [Path("a/my_new_scan.mtl"), Path("a/my_new_scan.png")]
    assert material_text("t.png").splitlines()[0] == "newmtl surface"
    assert "map_Kd t.png" in material_text("t.png")
    # As text in the .obj and as a name on the disk alike.
    assert material_files(Path("B\udce4ume.obj"))[0] == Path("B\ufffdume.mtl")
