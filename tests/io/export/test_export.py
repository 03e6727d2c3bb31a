"""Exports are opened by readers that nobody here wrote, and hold the result's values."""

from __future__ import annotations

import csv
import hashlib
import json
import re
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from dsl_core.errors import Cancelled, StoreError
from dsl_core.io.export import Format, export, export_by_ending, export_csv, export_png, formats
from dsl_core.io.export.common import provenance_of
from dsl_core.io.export.envi import export_envi
from dsl_core.io.export.exr import export_exr
from dsl_core.io.export.ply import export_ply
from dsl_core.io.export.png import GREY, flags_picture
from dsl_core.model.fit import ATTRIBUTE, Fit, FitFinding
from dsl_core.model.result import FLAG_COLOURS, Flag, reasons
from dsl_core.optics.colour import srgb_decode
from dsl_core.optics.relighting import relight
from dsl_core.solve.many import Check, never
from tests.cases.plugins import added_by_a_package
from tests.cases.small_result import (
    COLUMNS,
    OF_COLOUR_NM,
    ROWS,
    UNLIT,
    UNSURE,
    WARNED,
    WAVELENGTHS_NM,
    small_result,
)

SUFFIX = {
    "csv": ".csv",
    "envi": ".hdr",
    "exr": ".exr",
    "glb": ".glb",
    "mesh": ".ply",
    "npy": ".npy",
    "obj": ".obj",
    "ply": ".ply",
    "png": ".png",
    "stl": ".stl",
    "tiff": ".tiff",
}


def test_ply_in_meshio(tmp_path: Path) -> None:
    meshio = pytest.importorskip("meshio")
    result = small_result()
    (path,) = export_ply(result, tmp_path / "cloud.ply")
    mesh = meshio.read(path)
    lit = np.isfinite(result["depth_mm"].values)
    assert len(mesh.points) == ROWS * COLUMNS - 2
    np.testing.assert_array_equal(mesh.points.T, result["points_mm"].values[:, lit])
    fields = mesh.point_data
    for axis, name in enumerate(("nx", "ny", "nz")):
        np.testing.assert_array_equal(fields[name], result["normals"].values[axis, lit])
    for channel, name in enumerate(("red", "green", "blue")):
        # meshio 5.3.5 takes uchar for a signed byte.
        levels = fields[name].astype(np.uint8)
        np.testing.assert_allclose(levels, result["rgb"].values[channel, lit] * 255, atol=0.5)
    for band, wavelength in enumerate(("430", "432.5", "550", "655", "660")):
        np.testing.assert_array_equal(
            fields[f"scalar_{wavelength}nm"], result["reflectance"].values[band, lit]
        )
    np.testing.assert_array_equal(fields["scalar_depth_std_mm"], result["depth_std_mm"].values[lit])
    np.testing.assert_array_equal(fields["scalar_flags"], result["flags"].values[lit])


@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_ply_in_pyvista(tmp_path: Path) -> None:
    pyvista = pytest.importorskip("pyvista")
    result = small_result()
    (path,) = export_ply(result, tmp_path / "cloud.ply")
    lit = np.isfinite(result["depth_mm"].values)
    np.testing.assert_array_equal(pyvista.read(path).points.T, result["points_mm"].values[:, lit])


def test_ply_keeps_a_missing_band_as_nan_and_names_the_scan(tmp_path: Path) -> None:
    meshio = pytest.importorskip("meshio")
    result = small_result()
    result["reflectance"][1, 2, 2] = np.nan
    (path,) = export_ply(result, tmp_path / "cloud.ply")
    assert np.isnan(meshio.read(path).point_data["scalar_432.5nm"]).sum() == 1
    header = path.read_bytes().split(b"end_header")[0].decode("ascii")
    assert "comment scan_id: 2026-05-04-chart\n" in header
    assert "comment calibration: twin u-rig\n" in header
    assert "comment exported_by: dsl-scan" in header


def test_ply_with_a_long_provenance_is_read_by_all(tmp_path: Path) -> None:
    meshio = pytest.importorskip("meshio")
    from vtkmodules.vtkIOPLY import vtkPLYReader

    plan = json.dumps({"levels": [[0.125] * 3] * 6000})
    effects = "words of what was rendered, " * 200
    result = small_result().assign_attrs({"capture_plan": plan, "effects": effects, "a " * 300: "odd\nkey"})
    (path,) = export_ply(result, tmp_path / "cloud.ply")
    header = path.read_bytes().split(b"end_header")[0].decode("ascii")
    assert max(map(len, header.splitlines())) <= 240
    digest = hashlib.sha256(plan.encode()).hexdigest()[:16]
    assert 'comment capture_plan: {"levels": [[0.125' in header
    assert f"({len(plan)} characters, SHA-256 {digest}...; whole in the attributes of the result)" in header
    reader = vtkPLYReader()
    reader.SetFileName(str(path))
    reader.Update()
    lit = np.isfinite(result["depth_mm"].values)
    assert reader.GetOutput().GetNumberOfPoints() == lit.sum()
    np.testing.assert_array_equal(meshio.read(path).points.T, result["points_mm"].values[:, lit])


def test_what_the_model_does_not_fit_is_exported_in_words(tmp_path: Path) -> None:
    finding = FitFinding(
        part="film", name="place", value=1.0, std=None, unit="px", limit=0.1, significant=True,
        sentence="The film has moved.", advice="Calibrate it again.",
    )  # fmt: skip
    told = provenance_of({ATTRIBUTE: Fit.of([finding]).model_dump_json(), "rig": "twin"})
    assert told["verdict"].startswith("The model does not fit this rig and scene in every respect.")
    assert told["verdict"].endswith("The film has moved. Calibrate it again.")
    assert ATTRIBUTE not in told
    assert told["rig"] == "twin"


def test_ply_of_depth_alone(tmp_path: Path) -> None:
    meshio = pytest.importorskip("meshio")
    (path,) = export_ply(small_result()[["points_mm"]], tmp_path / "cloud.ply")
    mesh = meshio.read(path)
    assert len(mesh.points) == ROWS * COLUMNS - 2
    assert mesh.point_data == {}


def test_envi_in_spectral(tmp_path: Path) -> None:
    from spectral.io import envi

    result = small_result()
    files = export_envi(result, tmp_path / "cube.hdr")
    assert [f.name for f in files] == ["cube.hdr", "cube.img", "cube_std.hdr", "cube_std.img"]
    for name, header in (("reflectance", files[0]), ("reflectance_std", files[2])):
        image = envi.open(str(header))
        cube = np.moveaxis(np.asarray(image.load()), -1, 0)
        expected = result[name].values
        missing = np.isnan(expected)
        np.testing.assert_array_equal(cube[~missing], expected[~missing])
        assert missing.any()
        assert np.all(cube[missing] == float(image.metadata["data ignore value"]))
        assert image.bands.centers == list(WAVELENGTHS_NM)
        assert image.bands.band_unit == "Nanometers"
        assert "scan_id: 2026-05-04-chart" in image.metadata["description"]
    assert export_envi(result.drop_vars("reflectance_std"), tmp_path / "lone.hdr") == [
        tmp_path / "lone.hdr",
        tmp_path / "lone.img",
    ]


def test_exr_in_openexr(tmp_path: Path) -> None:
    import OpenEXR

    result = small_result()
    (path,) = export_exr(result, tmp_path / "cube.exr")
    with OpenEXR.File(str(path), separate_channels=True) as file:
        header, channels = file.header(), file.channels()
        bands = [f"T.{w},000000nm" for w in (430, 550, 655, 660)] + ["T.432,500000nm"]
        assert set(channels) == {*bands, "R", "G", "B", "Z"}
        for name, band in zip(bands, (0, 2, 3, 4, 1), strict=True):
            assert channels[name].pixels.dtype == np.float32
            np.testing.assert_array_equal(channels[name].pixels, result["reflectance"].values[band])
        np.testing.assert_array_equal(channels["Z"].pixels, result["depth_mm"].values)
        red = result["rgb"].values[0]
        np.testing.assert_allclose(channels["R"].pixels, srgb_decode(red), rtol=1e-6)
        assert header["spectralLayoutVersion"] == "1.0"
        assert header["dsl_scan_id"] == "2026-05-04-chart"


def test_exr_keeps_its_own_names_to_itself(tmp_path: Path) -> None:
    import OpenEXR

    own = {"version": "0.1.0", "type": "plane", "channels": "many", "chunkCount": 3, "name": "chart"}
    (path,) = export_exr(small_result().assign_attrs(own), tmp_path / "cube.exr")
    # The header's first bytes hold the number of the format; a string of the same name is not to be there.
    assert re.search(rb"(?<![a-z_])version\0string", path.read_bytes()) is None
    with OpenEXR.File(str(path), separate_channels=True) as file:
        header = file.header()
        assert {key: header[f"dsl_{key}"] for key in own} == {key: str(value) for key, value in own.items()}
        assert header["type"] == OpenEXR.scanlineimage
        assert len(file.channels()) == len(WAVELENGTHS_NM) + 4


@pytest.mark.parametrize("name", ["tiff", "npy"])
def test_depth_in_opencv_and_numpy(tmp_path: Path, name: str) -> None:
    import cv2

    result = small_result()
    files = export(result, tmp_path / f"depth.{name}", name)
    assert [f.name for f in files] == [f"depth.{name}", f"depth_std.{name}", f"depth_flags.{name}"]
    for file, variable, kind in zip(
        files, ("depth_mm", "depth_std_mm", "flags"), (np.float32, np.float32, np.uint16), strict=True
    ):
        read = np.load(file) if name == "npy" else np.asarray(cv2.imread(str(file), cv2.IMREAD_UNCHANGED))
        assert read.dtype == kind
        np.testing.assert_array_equal(read, result[variable].values)
    assert np.isnan(result["depth_mm"].values).any()
    (alone,) = export(result[["depth_mm"]], tmp_path / f"alone.{name}", name)
    assert alone.name == f"alone.{name}"


def test_a_tiff_says_what_it_holds_and_where_it_comes_from(tmp_path: Path) -> None:
    image = pytest.importorskip("PIL.Image")
    depth, _, flags = export(small_result(), tmp_path / "depth.tif", "tiff")
    with image.open(depth) as opened, image.open(flags) as beside:
        assert opened.tag_v2[270].startswith("Depth along the camera axis, mm; NaN")
        assert "scan_id: 2026-05-04-chart" in opened.tag_v2[270]
        assert "1 no light" in beside.tag_v2[270]


def test_linear_light_of_srgb() -> None:
    # IEC 61966-2-1: 0.5 encodes 0.21404, 0.04 lies on the straight piece.
    np.testing.assert_allclose(
        srgb_decode(np.array([0, 0.04, 0.5, 1], np.float32)), [0, 0.04 / 12.92, 0.214041, 1], rtol=1e-5
    )


def test_csv_in_the_csv_module(tmp_path: Path) -> None:
    import colour  # noqa: F401 - it changes how NumPy prints, which must not reach the file

    result = small_result()
    y, x = WARNED
    (path,) = export_csv(result, tmp_path / "spectra.csv", pixels=[(x, y), (UNLIT[1], UNLIT[0])])
    lines = path.read_text("utf-8").splitlines()
    assert "# calibration: twin μ-rig" in lines
    rows = list(csv.DictReader(line for line in lines if not line.startswith("#")))
    assert len(rows) == 2 * len(WAVELENGTHS_NM)
    for band, row in enumerate(rows[:5]):
        assert (row["x_px"], row["y_px"]) == (str(x), str(y))
        assert float(row["wavelength_nm"]) == WAVELENGTHS_NM[band]
        for name in ("reflectance", "reflectance_std", "data_share"):
            assert float(row[name]) == pytest.approx(result[name].values[band, y, x], rel=0.005)
        # Two digits beyond the first of the deviation.
        for name, place in (("reflectance", (band, y, x)), ("depth_mm", (y, x))):
            rounding = abs(float(row[name]) - float(result[name].values[place]))
            assert (
                rounding
                <= float(row[name.replace("_mm", "") + ("_std_mm" if "mm" in name else "_std")]) / 100
            )
        assert row["reasons"] == reasons(Flag.BANDS_UNREACHED)[0]
    assert [row["reach"] for row in rows[3:5]] == ["+1", "zero order only"]
    assert rows[9]["reach"] == "+1 and -1"
    assert rows[5]["reflectance"] == "nan"
    assert rows[5]["reasons"] == reasons(Flag.NO_LIGHT)[0]


@pytest.mark.parametrize(
    ("pixels", "says"),
    [
        ([], "needs pixels"),
        ([(9, 0)], r"\(9, 0\).*9 x 6"),
        ([(0, 0), (-1, 0), (0, 6)], r"\(-1, 0\), \(0, 6\)"),
    ],
)
def test_csv_refuses_pixels_that_are_not_there(
    tmp_path: Path, pixels: list[tuple[int, int]], says: str
) -> None:
    with pytest.raises(StoreError, match=says):
        export_csv(small_result(), tmp_path / "spectra.csv", pixels=pixels)
    assert list(tmp_path.iterdir()) == []


def test_png_in_opencv(tmp_path: Path) -> None:
    import cv2

    result = small_result()
    files = export_png(result, tmp_path / "view.png", band_nm=655)
    assert [f.name for f in files] == ["view_rgb.png", "view_depth.png", "view_655nm.png", "view_flags.png"]
    rgb, depth, band, flags = (np.asarray(cv2.imread(str(f)))[..., ::-1] for f in files)
    lit = np.isfinite(result["depth_mm"].values)
    np.testing.assert_allclose(rgb[lit], np.moveaxis(result["rgb"].values, 0, -1)[lit] * 255, atol=0.5)
    assert tuple(rgb[UNLIT]) == tuple(depth[UNLIT]) == GREY
    np.testing.assert_allclose(band[lit][:, 1], result["reflectance"].values[3][lit] * 255, atol=0.5)
    assert tuple(band[UNLIT]) == (0, 0, 96)
    red, blue = depth[5, 0, [0, 2]], depth[0, 8, [0, 2]]  # nearest and farthest pixel
    assert red[0] > red[1]
    assert blue[1] > blue[0]
    assert tuple(flags[0, 0]) == (255, 255, 255)
    assert bytes(flags[UNLIT]).hex() == FLAG_COLOURS[Flag.NO_LIGHT][1:]
    assert bytes(flags[UNSURE]).hex() == FLAG_COLOURS[Flag.CODE_UNSURE][1:]
    assert b"scan_id\0\0\0\0\0" + b"2026-05-04-chart" in files[0].read_bytes()


def test_png_shows_the_gravest_flag_whichever_bit_it_has() -> None:
    flags = np.array([[0, int(Flag.NOT_REFINED | Flag.NON_FINITE)], [int(Flag.NOT_REFINED), 0]], np.uint16)
    picture = flags_picture(flags)
    assert [bytes(picture[at]).hex() for at in ((0, 0), (0, 1), (1, 0))] == [
        "ffffff",
        FLAG_COLOURS[Flag.NON_FINITE][1:],
        FLAG_COLOURS[Flag.NOT_REFINED][1:],
    ]
    assert len(picture) == 2 + 18 * 2 + 4


@pytest.mark.parametrize(("adapted", "name"), [(True, "view_rgb_A.png"), (False, "view_rgb_A_unadapted.png")])
def test_png_under_another_light_says_so_in_its_name(tmp_path: Path, adapted: bool, name: str) -> None:
    import cv2

    result = small_result()
    file = export_png(result, tmp_path / "view.png", light="A", adapted=adapted)[0]
    assert file.name == name
    lit = np.isfinite(result["depth_mm"].values)
    wanted = relight(result["reflectance"].values, result["wavelength_nm"].values, "A", adapted)
    shown = np.asarray(cv2.imread(str(file)))[..., ::-1]
    np.testing.assert_allclose(shown[lit], np.moveaxis(wanted, 0, -1)[lit].clip(0, 1) * 255, atol=0.5)
    assert tuple(shown[UNLIT]) == GREY


def test_png_text_is_read_by_another_library(tmp_path: Path) -> None:
    pil = pytest.importorskip("PIL.Image")
    files = export_png(small_result(), tmp_path / "view.png")
    with pil.open(files[0]) as image:
        image.load()
        assert image.text["calibration"] == "twin μ-rig"


def test_colours_of_spectra_are_exported_where_a_result_holds_none(tmp_path: Path) -> None:
    result = small_result()
    own = export_png(result, tmp_path / "own.png")
    spectral = result.drop_vars("rgb")
    files = export_png(spectral, tmp_path / "spectral.png")
    assert [file.name for file in files] == [file.name.replace("own", "spectral") for file in own]
    points = [
        export(each, tmp_path / name, "ply")[0] for each, name in ((result, "a.ply"), (spectral, "b.ply"))
    ]
    assert points[0].stat().st_size == points[1].stat().st_size


def test_a_band_that_no_pixel_has_leaves_colours(tmp_path: Path) -> None:
    result = small_result(OF_COLOUR_NM)
    lacking = result.drop_vars("rgb").copy(deep=True)
    lacking["reflectance"][5] = np.nan
    for light in ("D65", "A"):
        file = export_png(lacking, tmp_path / "lacking.png", light=light, overwrite=True)[0]
        grey = (np.array(Image.open(file)) == GREY).all(-1)
        assert np.array_equal(grey, np.isnan(result["reflectance"].values).any(0)), light


def test_pictures_of_nothing_and_of_the_middle_band(tmp_path: Path) -> None:
    result = small_result()
    result["depth_mm"][...] = np.nan
    files = export_png(result, tmp_path / "view.png")
    assert files[2].name == "view_550nm.png"
    assert flags_picture(np.zeros((3, 4), np.uint16)).shape == (3, 4, 3)
    with pytest.raises(StoreError, match=r"no band at 800 nm.*430 to 660"):
        export_png(result, tmp_path / "other.png", band_nm=800)
    with pytest.raises(StoreError, match="needs rgb"):
        export_png(result[["shading"]], tmp_path / "other.png")


@pytest.mark.parametrize("name", sorted(formats()))
def test_every_format_refuses_to_replace_unless_allowed(tmp_path: Path, name: str) -> None:
    exporter = formats()[name].write
    if name == "csv":
        exporter = lambda result, path, *, overwrite=False, check=never: export_csv(  # noqa: E731
            result, path, overwrite=overwrite, pixels=[(0, 0)], check=check
        )
    path = tmp_path / "new" / f"x{SUFFIX[name]}"
    files = exporter(small_result(), path)
    assert files
    assert all(f.stat().st_size > 0 for f in files)
    assert sorted(f.name for f in path.parent.iterdir()) == sorted(f.name for f in files)
    files[-1].write_bytes(b"mine")
    with pytest.raises(StoreError, match="already exists"):
        exporter(small_result(), path)
    assert files[-1].read_bytes() == b"mine"
    exporter(small_result(), path, overwrite=True)
    assert files[-1].read_bytes() != b"mine"


@pytest.mark.parametrize("name", sorted(formats()))
def test_every_format_refuses_wrong_endings_and_places(tmp_path: Path, name: str) -> None:
    with pytest.raises(StoreError, match="does not end in"):
        export(small_result(), tmp_path / "x.doc", name)
    (tmp_path / "file").write_text("x")
    if name != "csv":
        with pytest.raises(StoreError, match="is a file, not a folder"):
            export(small_result(), tmp_path / "file" / f"x{SUFFIX[name]}", name)


@pytest.mark.parametrize("name", ["csv", "envi", "exr", "glb", "mesh", "npy", "obj", "ply", "stl", "tiff"])
def test_every_format_says_what_the_result_lacks(tmp_path: Path, name: str) -> None:
    with pytest.raises(StoreError, match="contains only shading"):
        export(small_result()[["shading"]], tmp_path / f"x{SUFFIX[name]}", name)


def test_a_package_adds_a_format_and_replaces_none(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def write(result: object, path: Path, *, overwrite: bool = False, check: Check = never) -> list[Path]:
        path.write_text("points")
        return [path]

    def silent(result: object, path: Path, *, overwrite: bool = False, check: Check = never) -> list[Path]:
        return None  # type: ignore[return-value]

    offered = [
        added_by_a_package(
            "dsl_scan.exporters", Format("las", ".las", "LAS – points", write, endings=(".laz",))
        ),
        added_by_a_package("dsl_scan.exporters", Format("ply", ".ply", "another PLY", write)),
        added_by_a_package("dsl_scan.exporters", ImportError("no such library")),
        added_by_a_package("dsl_scan.exporters", Format("Silent", ".silent", "Silent", silent)),
    ]
    with monkeypatch.context() as patch:
        patch.setattr("dsl_core.io.plugins.entry_points", lambda group: offered)
        formats.cache_clear()
        assert export_by_ending(small_result(), tmp_path / "a.laz") == [tmp_path / "a.laz"]
        assert formats()["ply"].about != "another PLY"
        with pytest.raises(StoreError, match="'Silent', which another package added, failed"):
            export_by_ending(small_result(), tmp_path / "a.silent")
    formats.cache_clear()
    assert "las" not in formats()
    assert "a package offers mine, which cannot be loaded" in caplog.text


def test_pixels_are_exported_to_a_table_alone(tmp_path: Path) -> None:
    (path,) = export_by_ending(small_result(), tmp_path / "a.csv", pixels=[(1, 0)])
    assert path == tmp_path / "a.csv"
    with pytest.raises(StoreError, match="Pixels are for csv, not for png"):
        export_by_ending(small_result(), tmp_path / "a.png", pixels=[(1, 0)])


def test_an_unknown_format(tmp_path: Path) -> None:
    with pytest.raises(StoreError, match="csv, envi, exr, glb, mesh, npy, obj, ply, png, stl, tiff"):
        export(small_result(), tmp_path / "x.las", "las")


@pytest.mark.parametrize("name", sorted(set(formats()) - {"csv"}))
def test_who_stops_an_export_finds_nothing_half_written(tmp_path: Path, name: str) -> None:
    asked, least = list[None](), 0

    def check() -> None:
        asked.append(None)
        if len(asked) == least:
            raise Cancelled("Stopped.")

    export(small_result(), tmp_path / "whole" / f"x{SUFFIX[name]}", name, check=check)
    least = len(asked)
    asked.clear()
    with pytest.raises(Cancelled):
        export(small_result(), tmp_path / "part" / f"x{SUFFIX[name]}", name, check=check)
    assert list(tmp_path.glob("part/*")) == []


def test_three_bands_are_red_green_and_blue_of_a_picture_in_their_order(tmp_path: Path) -> None:
    result = small_result()
    shades = np.array([0.1, 0.2, 0.5, 0.9, 0.3])[:, None, None]
    result["reflectance"].values[:] = np.broadcast_to(shades, result["reflectance"].shape)
    red_nm, green_nm, blue_nm = (float(WAVELENGTHS_NM[k]) for k in (3, 0, 2))
    chosen = red_nm, green_nm, blue_nm
    export_png(result, tmp_path / "view.png", bands_nm=chosen, bands_levels=(0.0, 1.0))
    name = "_".join(f"{nm:g}" for nm in chosen)
    picture = np.asarray(Image.open(tmp_path / f"view_{name}nm.png"))
    red, green, blue = picture[0, 0] / 255
    assert (red, green, blue) == pytest.approx((0.9, 0.1, 0.5), abs=0.01)
