import csv
import json
from pathlib import Path

import meshio
import numpy as np
import pytest
import spectral

import dsl_core as dsl
from dsl_core.analysis.classes import Member, SpectralClass
from dsl_core.analysis.classification import classify_result, write_classification
from dsl_core.analysis.mark_colours import mark_colour
from dsl_core.cli import main
from dsl_core.errors import DecodeError, StoreError
from dsl_core.io.result.annotations_file import Annotations, PinRecord, RegionRecord, save_annotations
from dsl_core.io.result.result_file import load_result, save_result
from dsl_core.optics.charts import chart_reflectance
from tests.cases.chart_cube import NM, chart_cube, chart_result

NAMES = ("dark {skin}, größer", "light skin", "blue sky")


@pytest.fixture(scope="module")
def found():  # type: ignore[no-untyped-def]
    result, cube = chart_result(), chart_cube()
    classes = [SpectralClass(n, (Member.of(s),)) for n, s in zip(NAMES, cube.spectra[:3], strict=True)]
    return result, classify_result(result, classes)


def test_spectral_opens_the_classification(found, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    result, made = found
    write_classification(result, made, tmp_path / "map.hdr")
    image = spectral.open_image(str(tmp_path / "map.hdr"))
    assert image.metadata["file type"] == "ENVI Classification"
    assert int(image.metadata["classes"]) == len(image.metadata["class names"]) == 6
    assert image.metadata["class names"][1:3] == ["dark (skin); grosser", "light skin"]
    assert len(image.metadata["class lookup"]) == 18
    assert np.array_equal(image.read_band(0), made.shown.values)


def test_meshio_opens_the_points_with_their_class(found, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    result, made = found
    write_classification(result, made, tmp_path / "map.ply")
    points = meshio.read(tmp_path / "map.ply")
    lit = np.isfinite(result["points_mm"].values[2])
    assert np.array_equal(points.point_data["scalar_class"], made.shown.values[lit])


def test_areas_are_those_of_the_surface(found) -> None:  # type: ignore[no-untyped-def]
    _, made = found
    by_name = {row.label: row for row in made.rows}
    # Pixels of a plane at 700 mm are 1 mm apart.
    for row in made.rows[:-1]:
        if row.area_std_mm2 is None or row.pixels_std is None:
            assert row.area_mm2 == pytest.approx(row.pixels, rel=1e-3)
            continue
        # Its edges add some, which is less than a count without them may be off by.
        assert row.area_mm2 is not None
        assert 0.999 * row.pixels <= row.area_mm2 < row.pixels + row.pixels_std
        assert row.area_std_mm2 <= 1.001 * row.pixels_std
    assert all((row.pixels_std is None) == (row.label not in NAMES) for row in made.rows)
    judged = sum(row.pixels for row in made.rows if row.value)
    for row in made.rows:
        assert (row.share_std is None) == (row.pixels_std is None)
        if row.share_std is not None and row.pixels_std is not None:
            assert row.share_std == pytest.approx(row.pixels_std / judged)
    assert by_name["none of these"].pixels > 40 * 60
    assert by_name["not judged"].pixels == 61
    assert by_name["not judged"].share is None


def test_the_table_is_written_with_its_method(found, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    result, made = found
    write_classification(result, made, tmp_path / "map.csv")
    lines = (tmp_path / "map.csv").read_text(encoding="utf-8").splitlines()
    rows = list(csv.DictReader(line for line in lines if not line.startswith("#")))
    assert lines[0].startswith("# method: probability")
    assert rows[0]["class"] == NAMES[0]
    assert sum(int(row["pixels"]) for row in rows) == made.shown.values.size
    # The sign of comments begins a colour as well.
    pandas = pytest.importorskip("pandas")
    table = pandas.read_csv(tmp_path / "map.csv", comment="#")
    assert table["pixels"].tolist() == [int(row["pixels"]) for row in rows]
    assert table["colour"].tolist() == [row["colour"] for row in rows]
    assert all(colour.startswith("#") for colour in table["colour"])
    with pytest.raises(StoreError, match="does not end in"):
        write_classification(result, made, tmp_path / "map.jpg")


def test_the_face_of_python_takes_places_and_libraries(tmp_path: Path) -> None:
    result, chart = chart_result(), chart_reflectance(NM)
    text = ["wavelength_nm,light skin", *(f"{nm},{v}" for nm, v in zip(NM, chart["light skin"], strict=True))]
    (tmp_path / "skin.csv").write_text("\n".join(text))
    made = dsl.classify(result, tmp_path, {"sky": (5, 40), "foliage": (0, 50, 20, 8)})
    assert list(made["label"].values)[1:4] == ["skin", "sky", "foliage"]
    assert (made["class"].values[18:30] == 1).mean() > 0.9
    assert (made["class"].values[34:46] == 2).mean() > 0.9
    assert float(made["area_mm2"].sel(label="skin")) == pytest.approx(960, rel=0.1)
    part = dsl.classify(result, pins={"sky": (5, 40)}, range_nm=(500, 600))
    assert (part["class"].values[34:46] == 1).mean() > 0.9


def test_the_face_of_python_tells_colours() -> None:
    made = dsl.colours(chart_result(), {"skin": (0, 18, 20, 10), "sky": (5, 40)}, ("A", "D65"), "sky")
    assert made["lab"].dims == ("place", "light", "component")
    skin = made.sel(place="skin", light="D65")
    # ISO 17321 and the charts since: light skin is about L* 66, a* 15, b* 17 under daylight.
    assert skin["lab"].values == pytest.approx([66, 15, 17], abs=2.5)
    assert 0 < float(skin["lab_std"][0]) < 1
    assert float(made["delta_e"].sel(place="sky", light="A")) == 0
    assert float(skin["delta_e"]) > 20


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"pins": {"x": (5, 95)}}, "none of its 1 pixels has a spectrum"),
        ({"pins": {"x": (1, 2, 3)}}, "a place is a mask"),
        (
            {"pins": {"a": (5, 5), "x": (200, 5)}},
            r"x: x 200, y 5, width 1, height 1 is outside the result",
        ),
        ({}, "Give a library of spectra, pins, or both"),
        ({"pins": {"x": (5, 5)}, "range_nm": (100, 200)}, "Only 0 bands"),
        ({"pins": {"x": (5, 5)}, "range_nm": (600, 500)}, "Give its lower end first"),
    ],
)
def test_wrong_places_are_told(options, words: str) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(DecodeError, match=words):
        dsl.classify(chart_result(), **options)


def test_a_result_of_depth_alone_is_told() -> None:
    depth = chart_result().drop_vars(["reflectance", "reflectance_std", "data_share"])
    with pytest.raises(DecodeError, match="depth only"):
        dsl.classify(depth, pins={"x": (5, 5)})


def test_the_command_names_pins_and_writes_files(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = save_result(chart_result(), tmp_path / "chart.zarr")
    marks = Annotations(
        pins=(PinRecord(name="sky", pixel=(9, 40), colour=5),),
        regions=(RegionRecord(name="skin", outline_px=((0, 17), (20, 17), (20, 30), (0, 30))),),
    )
    save_annotations(marks, path)
    target = tmp_path / "m.hdr"
    assert main(["classify", str(path), "--pins", "-o", str(target), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert [row["label"] for row in told["classes"]][:3] == ["sky", "skin", "none of these"]
    assert [row["colour"] for row in told["classes"]][:2] == [mark_colour(5), mark_colour(0)]
    assert target.is_file()
    assert load_result(path).sizes["y"] == 96
    for wrong, words in (
        (["classify", str(path)], "Say what to look for"),
        (["classify", str(path), "--at", "x=1"], "NAME=X,Y"),
        (["classify", str(path), "--pins", "--by", "svm"], "must be one of"),
        (["classify", str(path), "--pins", "-o", "m.jpg"], "must end in"),
    ):
        assert main(wrong) == 2
        assert words in capsys.readouterr().err


@pytest.mark.parametrize("command", ["classify", "spectra", "colours"])
def test_marks_are_asked_for_only_where_no_other_place_is_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], command: str
) -> None:
    path = save_result(chart_result(), tmp_path / "chart.zarr")
    assert main([command, str(path), "--pins"]) == 2
    told = capsys.readouterr().err
    assert "Nothing is marked on the result. Pin pixels or mark regions in the window first." in told
    assert "library" not in told
    assert main([command, str(path), "--pins", "--at", "leaf=9,40"]) == 0
    assert "leaf" in capsys.readouterr().out


def test_areas_that_nothing_tells_are_not_zero(found) -> None:  # type: ignore[no-untyped-def]
    result, made = found
    assert made.notes == ()
    cube = chart_cube()
    classes = [SpectralClass(n, (Member.of(s),)) for n, s in zip(NAMES, cube.spectra[:3], strict=True)]
    alone = classify_result(result.isel(x=slice(30, 31)), classes)
    (note,) = alone.notes
    assert "on one line" in note
    for row in alone.rows:
        assert row.area_std_mm2 is None or not row.pixels
        assert row.area_mm2 is not None
        assert np.isnan(row.area_mm2) if row.pixels else row.area_mm2 == 0
        assert row.area_text == "–" or not row.pixels
