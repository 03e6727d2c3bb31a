"""Class maps are read by libraries that nobody here wrote, class by class."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from dsl_core.errors import StoreError
from dsl_core.io.export.class_map import Classified, export_class_envi, export_class_ply
from tests.cases.small_result import COLUMNS, ROWS, small_result

VALUES = (np.arange(ROWS * COLUMNS).reshape(ROWS, COLUMNS) % 3).astype(np.uint8)
FOUND = Classified(
    values=VALUES,
    labels=("none", "leaf, {green}", "Großstein ü"),
    colours=("#000000", "#10a020", "#8090ff"),
    fit=np.linspace(0, 1, VALUES.size, dtype=np.float32).reshape(VALUES.shape),
    margin=np.linspace(2, 3, VALUES.size, dtype=np.float32).reshape(VALUES.shape),
    method="nearest angle, {library}",
)


def test_an_envi_classification_has_its_classes_with_names_and_colours(tmp_path: Path) -> None:
    from spectral.io import envi

    files = export_class_envi(small_result(), FOUND, tmp_path / "classes.hdr")
    assert files == [tmp_path / "classes.hdr", tmp_path / "classes.img"]
    header = envi.read_envi_header(str(files[0]))
    assert (header["samples"], header["lines"], header["bands"]) == (str(COLUMNS), str(ROWS), "1")
    assert (header["file type"], header["data type"], header["byte order"]) == (
        "ENVI Classification",
        "1",
        "0",
    )
    assert (header["header offset"], header["interleave"], header["classes"]) == ("0", "bsq", "3")
    assert header["class names"] == ["none", "leaf; (green)", "Grossstein u"]
    assert [int(level) for level in header["class lookup"]] == [0, 0, 0, 16, 160, 32, 128, 144, 255]
    assert header["description"].startswith("nearest angle; (library)")
    assert "scan_id: 2026-05-04-chart" in header["description"]
    np.testing.assert_array_equal(np.fromfile(files[1], np.uint8).reshape(ROWS, COLUMNS), VALUES)


def test_points_have_the_colour_of_their_class_with_fit_and_margin(tmp_path: Path) -> None:
    meshio = pytest.importorskip("meshio")
    result = small_result()
    (path,) = export_class_ply(result, FOUND, tmp_path / "classes.ply")
    lit = np.isfinite(result["points_mm"].values).all(0)
    mesh = meshio.read(path)
    np.testing.assert_array_equal(mesh.points.T, result["points_mm"].values[:, lit])
    np.testing.assert_array_equal(mesh.point_data["scalar_class"], VALUES[lit])
    np.testing.assert_array_equal(mesh.point_data["scalar_fit"], FOUND.fit[lit])
    np.testing.assert_array_equal(mesh.point_data["scalar_margin"], FOUND.margin[lit])
    wanted = np.array([[0, 0, 0], [16, 160, 32], [128, 144, 255]], np.uint8)[VALUES[lit]]
    for name, levels in zip(("red", "green", "blue"), wanted.T, strict=True):
        np.testing.assert_array_equal(mesh.point_data[name].astype(np.uint8), levels)
    head = path.read_bytes().split(b"end_header")[0].decode("ascii")
    assert "comment class 1: leaf, {green}\n" in head
    assert "comment method: nearest angle, {library}\n" in head
    assert "comment scan_id: 2026-05-04-chart\n" in head


def test_nothing_is_replaced_unasked_and_endings_are_those_of_the_format(tmp_path: Path) -> None:
    result = small_result()
    for write, name, other in ((export_class_envi, "x.hdr", "x.txt"), (export_class_ply, "x.ply", "x.txt")):
        write(result, FOUND, tmp_path / name)
        with pytest.raises(StoreError, match="already exists"):
            write(result, FOUND, tmp_path / name)
        write(result, FOUND, tmp_path / name, overwrite=True)
        with pytest.raises(StoreError, match="does not end in"):
            write(result, FOUND, tmp_path / other)
    with pytest.raises(StoreError, match="A PLY file needs points_mm"):
        export_class_ply(result.drop_vars("points_mm"), FOUND, tmp_path / "y.ply")
