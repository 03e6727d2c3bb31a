"""Pictures of another program become a scan, and its depth, complete or not at all."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from dsl_app.importing.captures.carry_out import carry_out
from dsl_app.importing.captures.fields import first_mapping
from dsl_app.importing.captures.state import NOMINAL

from dsl_core.errors import StoreError
from dsl_core.io.calibration_library import CalibrationLibrary
from dsl_core.io.result.result_file import load_result
from dsl_core.io.scan.folder import ScanReader
from dsl_core.progress import NoProgress
from tests.app.importing.captures.small_capture import PROJECTOR, request_for

MAPPING = first_mapping(12, PROJECTOR)


def test_an_import_without_calibration_tells_its_columns(folder: Path, tmp_path: Path) -> None:
    request = request_for(folder, tmp_path)
    made = carry_out(request, MAPPING, CalibrationLibrary(tmp_path / "library"), NoProgress())
    assert made.result is None
    assert "of the lit pixels have a column. There is no depth" in made.verdict
    assert not ScanReader(made.scan).missing()


def test_an_import_that_fails_leaves_nothing(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> None:
        raise StoreError("The disk is full.")

    monkeypatch.setattr("dsl_core.workflows.captures._write", full)
    with pytest.raises(StoreError, match="full"):
        carry_out(request_for(folder, tmp_path), MAPPING, CalibrationLibrary(tmp_path / "l"), NoProgress())
    assert not list(tmp_path.iterdir())


def test_an_import_with_a_calibration_has_depth(folder: Path, tmp_path: Path) -> None:
    # The wall of the scene is where lenses of these focal lengths, 100 mm apart, see it shifted like this.
    camera, projector = ([[50.0, 0, 32], [0, 50.0, 24], [0, 0, 1]], [[22.5, 0, 12], [0, 22.5, 12], [0, 0, 1]])
    parts = {"cam_K": camera, "proj_K": projector, "R": np.eye(3).tolist(), "T": [100.0, 0, 0]}
    file = tmp_path / "stereo.json"
    file.write_text(json.dumps(parts))
    request = replace(request_for(folder, tmp_path), calibration=str(file))
    made = carry_out(request, MAPPING, CalibrationLibrary(tmp_path / "library"), NoProgress())
    assert made.result == tmp_path / "a.zarr"
    assert "of the pixels have a depth" in made.verdict
    result = load_result(made.result)
    assert "reflectance" not in result
    wall = result["depth_mm"].values[:8, 8:24]
    assert np.nanmedian(wall) == pytest.approx(22.5 * 100 / 3.75, rel=0.1)


@pytest.mark.parametrize("taken", ["a.dsl", "a.zarr"])
def test_what_exists_stops_an_import_before_any_work(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, taken: str
) -> None:
    def too_late(*_: object) -> None:
        raise AssertionError("pictures were read")

    (tmp_path / taken).mkdir()
    monkeypatch.setattr("dsl_core.io.pictures.source.open_pictures", too_late)
    request = replace(request_for(folder, tmp_path), calibration=NOMINAL)
    with pytest.raises(StoreError, match=f"{taken} already exists. Choose another name or folder"):
        carry_out(request, MAPPING, CalibrationLibrary(tmp_path / "library"), NoProgress())
    assert [each.name for each in tmp_path.iterdir()] == [taken]
