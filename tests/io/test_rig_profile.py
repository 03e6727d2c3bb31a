"""Profiles are opened by path and by name, listed with the rigs, and say what is wrong with them."""

from __future__ import annotations

from pathlib import Path

import pytest

from dsl_core.devices.driver_table import driver_names, read_settings
from dsl_core.devices.profile import DevicePart, RigProfile
from dsl_core.devices.registry import is_built_in, list_rigs, open_rig, rig_names
from dsl_core.errors import CalibrationError, DeviceError
from dsl_core.io.rig_profile import (
    examine_profile,
    load_profile,
    profile_path,
    profiles_folder,
    save_profile,
)
from dsl_core.io.scan.origin import rig_notes, rig_of_notes
from dsl_core.resources import resource_path

NOWHERE = DevicePart(driver="none", settings={"size_px": [64, 48]})


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("DSL_SCAN_HOME", str(tmp_path))
    profiles_folder().mkdir()
    return tmp_path


def profile(**changes: object) -> RigProfile:
    fields = {"name": "lab", "camera": DevicePart(driver="absent"), "projector": NOWHERE}
    return RigProfile.model_validate(fields | changes)


def test_a_profile_is_found_by_path_and_by_name(home: Path) -> None:
    path = save_profile(profile(note="Room 12"), profiles_folder() / "lab.json")
    assert profile_path("lab") == profile_path(str(path)) == path
    assert load_profile(path) == profile(note="Room 12")
    assert rig_names() == ["lab", "replay", "twin"]
    assert not is_built_in("lab")
    entry = next(entry for entry in list_rigs() if entry.name == "lab")
    assert entry.description == "Room 12: camera absent, projector none"
    for name in ("lab", str(path)):
        with pytest.raises(DeviceError, match="no driver 'absent' for a camera"):
            open_rig(name)


def test_a_damaged_profile_is_listed_with_the_reason(home: Path) -> None:
    (profiles_folder() / "bad.json").write_text('{"name": "bad", "camera": {"drive": "x"}}')
    entry = next(entry for entry in list_rigs() if entry.name == "bad")
    assert "camera.driver" in entry.error
    assert "projector" in entry.error


def test_names_that_leave_the_folder_and_options_are_refused(home: Path) -> None:
    save_profile(profile(), home / "other.json")
    assert profile_path("../other") is None
    with pytest.raises(DeviceError, match="takes no options, given: size"):
        open_rig(str(home / "other.json"), {"size": "3x3"})
    with pytest.raises(DeviceError, match="cannot be read"):
        open_rig(str(home / "missing.json"))


def test_a_missing_nominal_rig_is_named(home: Path) -> None:
    path = save_profile(profile(nominal="sheet.json"), home / "lab.json")
    with pytest.raises(CalibrationError, match=r"sheet\.json"):
        open_rig(str(path))


def test_the_doctor_tells_of_a_missing_nominal_rig_with_all_else(home: Path) -> None:
    path = save_profile(profile(nominal="sheets.json"), home / "lab.json")
    found = {each.device: each for each in examine_profile(path)}
    assert "no driver 'absent'" in found["camera absent"].text
    assert found["data sheets"].grade == "bad"
    assert "sheets.json cannot be read" in found["data sheets"].text


def test_a_scan_remembers_its_profile_from_any_folder(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(home)
    assert rig_of_notes(rig_notes("lab.json", {})) == (str(home / "lab.json"), {})
    assert rig_of_notes(rig_notes("lab", {})) == ("lab", {})


def test_the_example_of_the_help_is_valid_for_its_drivers() -> None:
    text = resource_path("help/connecting-devices.md").read_text(encoding="utf-8")
    example = RigProfile.model_validate_json(text.split("```json")[1].split("```")[0])
    assert set(example.parts()) == {"camera", "projector", "stage"}
    for kind, part in example.parts().items():
        assert read_settings(kind, part.driver, part.settings)
    for kind in ("camera", "projector"):
        for name in driver_names(kind):
            assert f"| `{name}` |" in text
