"""Pictures of other programs become scans that tell columns, and depth once their rig is known."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

import numpy as np
import pytest

from dsl_core.errors import CalibrationError, StoreError
from dsl_core.io.pictures.mapping import BlackPicture, Mapping, StripePictures, WhitePicture
from dsl_core.io.records import write_record
from dsl_core.io.scan.folder import ScanReader
from dsl_core.model.captured_code import Stripes
from dsl_core.workflows import captures
from tests.cases.foreign_captures import CAMERA, PROJECTOR, frames, scene, write
from tests.cases.small_rig import small_rig

MAPPING = Mapping(
    parts=(StripePictures(bits=7, inverse="none"), WhitePicture(), BlackPicture()),
    projector_size_px=PROJECTOR,
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    pictures, white, black = frames([("columns", Stripes(bits=7, inverse=False))])
    named = {f"{i}.png": p for i, p in enumerate([*pictures, white, black])}
    return write(tmp_path_factory.mktemp("foreign") / "set", named)


def test_an_import_tells_the_columns_of_the_scene(folder: Path, tmp_path: Path) -> None:
    captures.import_pictures(folder, tmp_path / "a.dsl", MAPPING)
    result = captures.decode_scan(tmp_path / "a.dsl")
    error = result["column_px"].values - scene().columns
    known = np.isfinite(error)
    assert known.mean() > 0.95
    assert np.percentile(np.abs(error[known]), 97) < 0.55
    assert "depth_mm" not in result
    assert "--calibration" in result.attrs[captures.NO_DEPTH]
    reader = ScanReader(tmp_path / "a.dsl")
    assert reader.manifest.plan.camera_size_px == CAMERA
    assert Mapping.model_validate_json(reader.manifest.notes[captures.MAPPING]) == MAPPING


def test_an_import_resumes_but_never_replaces(folder: Path, tmp_path: Path) -> None:
    captures.import_pictures(folder, tmp_path / "a.dsl", MAPPING)
    captures.import_pictures(folder, tmp_path / "a.dsl", MAPPING)
    other = MAPPING.model_copy(update={"bit_depth": 10})
    with pytest.raises(StoreError, match="never replaced"):
        captures.import_pictures(folder, tmp_path / "a.dsl", other)


def test_another_calibration_is_never_dropped_without_a_word(folder: Path, tmp_path: Path) -> None:
    rig, target = small_rig(), tmp_path / "a.dsl"
    sizes = {
        name: getattr(rig, name).model_copy(update={"width_px": width, "height_px": height})
        for name, (width, height) in (("camera", CAMERA), ("projector", PROJECTOR))
    }
    rig = rig.model_copy(update=sizes)
    captures.import_pictures(folder, tmp_path / "none.dsl", MAPPING)
    captures.import_pictures(folder, target, MAPPING, rig)
    captures.import_pictures(folder, target, MAPPING, rig)
    other = rig.model_copy(update={"white_scale": 3.0})
    with pytest.raises(StoreError, match=r"with another calibration.*another name, or give this calibration"):
        captures.import_pictures(folder, target, MAPPING, other)
    with pytest.raises(StoreError, match=r"with a calibration\. .* choose another name\.$"):
        captures.import_pictures(folder, target, MAPPING)
    with pytest.raises(StoreError, match="imported without a calibration"):
        captures.import_pictures(folder, tmp_path / "none.dsl", MAPPING, rig)


def test_light_that_was_not_captured_is_made_of_the_others(tmp_path: Path) -> None:
    pictures, white, _ = frames([("columns", Stripes(bits=7))])
    root = write(tmp_path / "set", {f"{i:02d}.png": p for i, p in enumerate(pictures)})
    mapping = Mapping(parts=(StripePictures(bits=7),), projector_size_px=PROJECTOR)
    source = captures.import_pictures(root, tmp_path / "a.dsl", mapping)
    assert source.made_up == ("white", "black")
    reader = ScanReader(tmp_path / "a.dsl")
    assert "white and black" in reader.manifest.notes["not_captured"]
    made = next(reader.read(shot) for shot in reader.plan.shots() if shot.role == "white")
    lit = white > 60
    assert np.median(np.abs(made[lit].astype(int) - white[lit])) < 6


def test_a_calibration_for_other_sizes_is_refused(folder: Path, tmp_path: Path) -> None:
    with pytest.raises(CalibrationError, match=r"160 x 120 px; the calibration .* is for"):
        captures.import_pictures(folder, tmp_path / "a.dsl", MAPPING, small_rig())
    assert not (tmp_path / "a.dsl").exists()


def test_a_mapping_is_kept_as_a_file_and_its_faults_named(tmp_path: Path) -> None:
    path = write_record(tmp_path / "m.json", MAPPING)
    assert captures.load_mapping(path) == MAPPING
    (tmp_path / "bad.json").write_text(
        '{"parts": [{"kind": "stripes", "bits": 99}], "projector_size_px": [8, 4]}'
    )
    with pytest.raises(StoreError, match=r"bad\.json is not a mapping: parts\.0\.stripes\.bits.*--guess"):
        captures.load_mapping(tmp_path / "bad.json")


def test_a_mapping_that_states_no_direction_of_sinusoids_is_unsure_of_it(tmp_path: Path) -> None:
    text = '{"parts": [{"kind": "phases", "axis": "rows", "fringes": [1, 8], "steps": 4%s}], %s}'
    size = '"projector_size_px": [96, 64]'
    (path := tmp_path / "a.json").write_text(text % ("", size), encoding="utf-8")
    (doubt,) = captures.load_mapping(path).unsure
    assert doubt.startswith("sinusoids do not say which way rows rise: direction 1 (frame k of N")
    path.write_text(text % (', "direction": 1', size), encoding="utf-8")
    assert captures.load_mapping(path).unsure == ()


def test_columns_without_depth_are_exported_as_arrays(folder: Path, tmp_path: Path) -> None:
    from dsl_core.io.export.depth_maps import export_npy

    captures.import_pictures(folder, tmp_path / "a.dsl", MAPPING)
    result = captures.decode_scan(tmp_path / "a.dsl")
    files = export_npy(result, tmp_path / "a.npy")
    assert [file.name for file in files] == ["a_column.npy", "a_column_std.npy"]
    assert np.array_equal(np.load(files[0]), result["column_px"].values, equal_nan=True)


@pytest.mark.skipif(sys.platform != "linux", reason="the system has only names in UTF-8")
def test_a_folder_whose_name_is_not_in_utf_8_is_imported(folder: Path, tmp_path: Path) -> None:
    named = shutil.copytree(folder, tmp_path / "B\udce4ume")
    captures.import_pictures(named, tmp_path / "a.dsl", MAPPING)
    assert ScanReader(tmp_path / "a.dsl").manifest.notes["imported_from"] == "B\ufffdume"
