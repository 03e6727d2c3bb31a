"""Rigs survive the disk to the last digit, and wrong ones are refused field by field."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from dsl_core.errors import CalibrationError, StoreError
from dsl_core.io.rig_file import load_rig, save_rig
from tests.cases.small_rig import small_rig

CURVE = {"wavelengths_nm": [550.0], "values": [0.1]}


def test_a_rig_comes_back_unchanged(tmp_path: Path) -> None:
    rig = small_rig()
    path = save_rig(rig, tmp_path / "new" / "rig.json")
    assert load_rig(path) == rig
    assert [p.name for p in path.parent.iterdir()] == ["rig.json"]


def test_a_rig_is_replaced_only_when_allowed(tmp_path: Path) -> None:
    path = save_rig(small_rig(), tmp_path / "rig.json")
    other = small_rig().model_copy(update={"name": "other"})
    with pytest.raises(StoreError, match="already exists"):
        save_rig(other, path)
    assert load_rig(path).name == "small"
    save_rig(other, path, overwrite=True)
    assert load_rig(path).name == "other"


def _edited(tmp_path: Path, *steps: str | int, value: object) -> Path:
    content: Any = json.loads(small_rig().model_dump_json())
    spot = content
    for step in steps[:-1]:
        spot = spot[step]
    spot[steps[-1]] = value
    path = tmp_path / "rig.json"
    path.write_text(json.dumps(content))
    return path


@pytest.mark.parametrize(
    ("steps", "value", "says"),
    [
        (("camera", "fx_px"), -3, r"camera\.fx_px .*greater than 0 \(given -3\)"),
        (("film", "distance_mm"), "far", r"film\.distance_mm .*\(given 'far'\)"),
        (("response", 1, "values"), [1.0], r"response\.1: .*one value per wavelength"),
        (("pose", "rotation"), [[1, 0, 0], [0, 1, 0], [0, 0, 2]], "pose: .*orthonormal"),
        (("white_scale",), float("nan"), r"white_scale .*finite"),
        (("colour",), "red", "colour is not a field"),
        (("schema_version",), 2, "schema version 2; this program supports version 1"),
        (("film", "distance_mm"), 0.029, r"film\.distance_mm must be greater than 1 \(given 0.029\)"),
        (("film", "distance_mm"), 29000.0, r"film\.distance_mm must be less than 500"),
        (("pose", "translation_mm"), [-0.055, -0.02, 0.022], r"pose: .* apart, given 0\.0625 mm; .* in mm"),
        (("response", 2, "values"), [0.0, 0.0, 0.0], r"response\.2: .*above zero"),
        (("emission", 0, "values"), [0.0, -0.05, -1.0], r"emission\.0: .*not be negative, given -1"),
        (("emission", 1, "wavelengths_nm"), [0.43, 0.545, 0.66], r"emission\.1: .*in nm, .*given 0\.43"),
        (("response", 0, "std"), [0.1, -0.1, 0.1], r"response\.0: .*deviation must not be negative"),
        (("efficiency",), {}, "efficiency: order 1 or -1 must be there"),
        (("efficiency",), {"2": CURVE}, "efficiency: order 1 or -1 must be there"),
        (("efficiency", "-1"), {**CURVE, "values": [-1.0]}, "efficiency: order -1 must not be negative"),
        (("efficiency", "2"), {**CURVE, "values": [-0.05]}, "efficiency: order 2 must not be negative"),
        (("chain_rel_std",), {**CURVE, "values": [-0.1]}, "chain_rel_std: .*not be negative"),
        (("sensor", "black_level_dn"), 9000.0, "sensor: black_level_dn, 9000 DN, must be below .* 4095 DN"),
        (("depth_range_mm",), [1000.0, 500.0], "depth_range_mm: a range must rise, given 1000 to 500"),
        (("geometry_covariance",), [1.0, 2.0], "geometry_covariance must have at least 576 values"),
    ],
)
def test_errors_name_the_field(
    tmp_path: Path, steps: tuple[str | int, ...], value: object, says: str
) -> None:
    with pytest.raises(CalibrationError, match=says):
        load_rig(_edited(tmp_path, *steps, value=value))


def test_an_order_without_light_is_noise_around_zero(tmp_path: Path) -> None:
    noise = {"wavelengths_nm": [430.0, 545.0, 660.0], "values": [-1e-4, 5e-5, 8e-5]}
    found = load_rig(_edited(tmp_path, "efficiency", "-2", value=noise))
    assert found.efficiency[-2].values == (-1e-4, 5e-5, 8e-5)


def test_many_problems_are_told_at_once_but_not_all(tmp_path: Path) -> None:
    (tmp_path / "rig.json").write_text("{}")
    with pytest.raises(CalibrationError, match=r"name is missing.*camera.*and 4 more"):
        load_rig(tmp_path / "rig.json")


@pytest.mark.parametrize(
    ("content", "says"),
    [(b"{", "not JSON"), (b"[]", "JSON object"), (b"\xff\xfe", "cannot be read"), (b"", "not JSON")],
)
def test_files_that_are_no_rig(tmp_path: Path, content: bytes, says: str) -> None:
    (tmp_path / "rig.json").write_bytes(content)
    with pytest.raises(CalibrationError, match=says):
        load_rig(tmp_path / "rig.json")


def test_a_missing_file(tmp_path: Path) -> None:
    with pytest.raises(CalibrationError, match=r"nowhere\.json cannot be read"):
        load_rig(tmp_path / "nowhere.json")
