"""Calibrations are kept by name and date, brought back without loss, and listed also when damaged."""

from __future__ import annotations

from pathlib import Path

import pytest

from dsl_core.errors import CalibrationError, StoreError
from dsl_core.io.calibration_library import CalibrationLibrary, load_calibration
from dsl_core.io.campaign_folder import CampaignFolder
from dsl_core.io.rig_file import save_rig
from dsl_core.model.rig import Rig
from tests.cases.small_rig import small_rig


@pytest.fixture
def library(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> CalibrationLibrary:
    monkeypatch.setenv("DSL_SCAN_HOME", str(tmp_path / "home"))
    return CalibrationLibrary()


def brighter(scale: float) -> Rig:
    return small_rig().model_copy(update={"white_scale": scale})


def test_versions_stay_and_the_newest_is_current(library: CalibrationLibrary) -> None:
    old = library.store("lab 3", brighter(1.0))
    new = library.store("lab 3", brighter(2.0))
    assert library.find("lab 3") == new
    assert library.find(f"lab 3@{old.stamp}") == old
    assert library.restore("lab 3", old.stamp) == old
    assert library.find("lab 3") == old
    assert [(line.stamp, line.is_current) for line in library.lines()] == [
        (new.stamp, False),
        (old.stamp, True),
    ]
    assert library.home.parent.name == "home"


def test_a_name_whose_first_version_is_being_written_is_none_yet(library: CalibrationLibrary) -> None:
    library.store("lab 3", brighter(1.0))
    (library.home / "lab 4" / "versions").mkdir(parents=True)
    assert library.names() == ("lab 3",)
    assert [line.name for line in library.lines()] == ["lab 3"]


def test_a_damaged_version_is_listed_with_its_reason_and_nothing_changes(
    library: CalibrationLibrary,
) -> None:
    bad, good = library.store("a", brighter(1.0)), library.store("a", brighter(2.0))
    path = library.home / "a" / "versions" / f"{bad.stamp}.json"
    path.write_bytes(path.read_bytes()[:99])
    lines = {line.stamp: line for line in library.lines()}
    assert lines[good.stamp].entry == good
    assert lines[bad.stamp].entry is None
    assert "is damaged or from another version" in lines[bad.stamp].error
    with pytest.raises(StoreError, match="is damaged"):
        library.restore("a", bad.stamp)
    assert library.find("a") == good
    (library.home / "a" / "current").unlink()
    assert library.find("a") == good


def test_wrong_names_are_told(library: CalibrationLibrary) -> None:
    assert library.lines() == ()
    with pytest.raises(StoreError, match="no calibration 'b'; it has: none"):
        library.find("b")
    for name in ("../up", "", ".hidden", "a/b"):
        with pytest.raises(StoreError, match="cannot be named"):
            library.store(name, small_rig())
    library.store("b", small_rig())
    with pytest.raises(StoreError, match="'b' has no version 1999"):
        library.restore("b", "1999")
    library.store("b", small_rig())
    with pytest.raises(StoreError, match="'b' has 2 versions 2"):
        library.restore("b", "2")


def test_a_calibration_is_found_by_name_or_file(library: CalibrationLibrary, tmp_path: Path) -> None:
    entry = library.store("b", brighter(3.0))
    assert load_calibration("b") == entry.rig
    assert load_calibration(str(save_rig(brighter(4.0), tmp_path / "rig.json"))).white_scale == 4.0
    stored = library.home / "b" / "versions" / f"{entry.stamp}.json"
    assert load_calibration(str(stored)) == entry.rig
    with pytest.raises(StoreError, match=r"There is no file nowhere\.json"):
        load_calibration("nowhere.json")
    with pytest.raises(StoreError, match=r"is a folder\. Give the path of a rig's"):
        load_calibration(str(tmp_path))
    campaign = CampaignFolder.begin(tmp_path / "lab", "twin", {}).path
    with pytest.raises(StoreError, match=r"There is no file .*lab.rig\.json"):
        load_calibration(str(campaign))
    save_rig(brighter(5.0), campaign / "rig.json")
    assert load_calibration(f"{campaign}/").white_scale == 5.0
    (tmp_path / "text.json").write_text("{}")
    with pytest.raises(CalibrationError, match="not valid"):
        load_calibration(str(tmp_path / "text.json"))


def test_the_folder_of_its_campaign_does_not_hide_a_name(
    library: CalibrationLibrary, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    CampaignFolder.begin(Path("lab"), "twin", {})
    save_rig(brighter(4.0), Path("lab/rig.json"))
    library.store("lab", brighter(3.0))
    assert load_calibration("lab").white_scale == 3.0
