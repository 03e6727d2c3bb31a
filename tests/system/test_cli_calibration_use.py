"""A scan takes the calibration it is told to, and refuses one that was made with other settings."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from dsl_core.devices import registry
from dsl_core.devices.conditions import current_conditions
from dsl_core.devices.registry import open_rig
from dsl_core.io.calibration_library import CalibrationLibrary
from dsl_core.io.result.result_file import load_result
from dsl_core.io.rig_file import save_rig
from dsl_core.io.scan.folder import ScanReader
from dsl_core.model.calibration.accepted import MISSED_ATTRIBUTE, CalibrationNote, read_missed
from dsl_core.model.figure import Figure
from dsl_core.model.rig import Rig
from dsl_core.workflows import scans

from .conftest import SMALL_RIG, Give

QUICK = ["--code", "columns", "--lines", "64x64", "--setting", "50@0.8"]


@pytest.fixture
def calibrated(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Rig:
    """The twin's own calibration with its conditions, as ``lab`` in an empty library."""
    monkeypatch.setenv("DSL_SCAN_HOME", str(tmp_path / "home"))
    with open_rig("twin", {"size": "112x72"}) as devices:
        assert devices.calibration is not None
        update = {"conditions": current_conditions(devices), "name": "lab", "white_scale": 33.0}
        rig = devices.calibration.model_copy(update=update)
    CalibrationLibrary().store("lab", rig)
    return rig


def with_gain(rig: Rig, gain_db: float) -> Rig:
    assert rig.conditions is not None
    camera = rig.conditions.camera.model_copy(update={"gain_db": gain_db})
    return rig.model_copy(update={"conditions": rig.conditions.model_copy(update={"camera": camera})})


def test_a_scan_stores_the_calibration_it_is_told(give: Give, tmp_path: Path, calibrated: Rig) -> None:
    scan = tmp_path / "scan.dsl"
    assert give("scan", scan, *SMALL_RIG, *QUICK, "--calibration", "lab").code == 0
    assert ScanReader(scan).calibration == calibrated
    (scan / "frames" / "c.7.0.0").unlink()
    assert give("resume", scan).code == 0
    assert "no calibration 'lob'; it has: lab" in give(
        "scan", tmp_path / "b.dsl", *SMALL_RIG, *QUICK, "--calibration", "lob"
    ).sentence  # fmt: skip


def test_a_scan_without_calibration_says_what_comes_before_its_reconstruction(
    give: Give, tmp_path: Path, calibrated: Rig, monkeypatch: pytest.MonkeyPatch
) -> None:
    command = ["scan", tmp_path / "with.dsl", *SMALL_RIG, *QUICK]
    assert f"Next: dsl-scan reconstruct {command[1]}\n" in give(*command).out
    monkeypatch.setattr(
        registry, "open_rig", lambda name, options: replace(open_rig(name, options), calibration=None)
    )
    first = give("scan", tmp_path / "first.dsl", *SMALL_RIG, *QUICK).out
    assert f"Next: dsl-scan reconstruct {tmp_path / 'first.dsl'} --calibration NAME" in first
    assert "in the library, which has: lab." in first
    monkeypatch.setenv("DSL_SCAN_HOME", str(tmp_path / "empty"))
    second = give("scan", tmp_path / "second.dsl", *SMALL_RIG, *QUICK).out
    assert (
        "Next: calibrate the rig with 'dsl-scan calibrate all CAMPAIGN --rig twin --option size=112x72'"
        in second
    )
    assert f"then dsl-scan reconstruct {tmp_path / 'second.dsl'} --calibration CAMPAIGN" in second


@pytest.mark.slow
def test_a_scan_ends_with_what_was_found_of_its_pictures(
    give: Give, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scan = tmp_path / "scan.dsl"
    command = ["scan", scan, *SMALL_RIG, *QUICK]
    assert give(*command).out.endswith(f"Next: dsl-scan reconstruct {scan}\n")
    monkeypatch.setattr(scans, "known_doubts", lambda folder: ["Black is grey."] if folder == scan else [])
    (scan / "frames" / "c.7.0.0").unlink()
    assert give("resume", scan).out.endswith(f"Next: dsl-scan reconstruct {scan}\nBlack is grey.\n")


def test_other_settings_are_refused_unless_overridden(give: Give, tmp_path: Path, calibrated: Rig) -> None:
    file = save_rig(with_gain(calibrated, 12.0), tmp_path / "other.json")
    command = ["scan", tmp_path / "scan.dsl", *SMALL_RIG, *QUICK, "--calibration", file]
    ending = give(*command)
    assert ending.code == 2
    assert "the camera's gain (dB) was 12 and is 0" in ending.sentence
    assert not (tmp_path / "scan.dsl").exists()
    assert give(*command, "--override-calibration").code == 0
    reader = ScanReader(tmp_path / "scan.dsl")
    assert reader.manifest.notes["calibration_overridden"] == "the camera's gain (dB) was 12 and is 0"
    assert reader.calibration is not None
    assert reader.calibration.white_scale == 33.0


@pytest.mark.slow
def test_a_reconstruction_refuses_it_as_well(
    give: Give, tmp_path: Path, scan_copy: Path, calibrated: Rig
) -> None:
    file = save_rig(with_gain(calibrated, 12.0), tmp_path / "other.json")
    command = ["reconstruct", scan_copy, "-o", tmp_path / "a.zarr", "--depth-only", "--calibration"]
    assert "the camera's gain (dB) was 12 and is 0 in the scan" in give(*command, file).sentence
    assert give(*command, file, "--override-calibration").code == 0
    assert give(*command, "lab", "--force").code == 0


@pytest.mark.slow
def test_what_a_calibration_missed_travels_with_the_rig(
    give: Give, tmp_path: Path, scan_copy: Path, calibrated: Rig
) -> None:
    figures = (Figure(name="camera error", value=0.6, unit="px", high=0.5),)
    note = CalibrationNote(name="geometry", title="Geometry", accepted="2026-05-04", figures=figures)
    file = save_rig(calibrated.model_copy(update={"calibrations": (note,)}), tmp_path / "missed.json")
    told = (
        "This rig's calibration 'Geometry' missed its limit: camera error 0.600 px (limit: at most 0.5 px)."
    )
    scan = give("scan", tmp_path / "new.dsl", *SMALL_RIG, *QUICK, "--calibration", file)
    assert scan.code == 0, scan.err
    assert told in scan.out
    result = tmp_path / "a.zarr"
    made = give("reconstruct", scan_copy, "-o", result, "--depth-only", "--calibration", file, "--json")
    assert made.json["calibration_missed"] == [told]
    assert read_missed(load_result(result).attrs) == (told,)
    # A rig that reached all its limits says nothing.
    made = give("reconstruct", scan_copy, "-o", result, "--depth-only", "--calibration", "lab", "--force")
    assert "missed its limit" not in made.out
    assert MISSED_ATTRIBUTE not in load_result(result).attrs


def test_a_name_of_the_library_is_exported(
    give: Give, tmp_path: Path, calibrated: Rig, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert calibrated.name == "lab"
    monkeypatch.chdir(tmp_path)
    Path("lab").mkdir()  # a folder called so is that of its campaign
    assert give("export", "lab", "calibration", tmp_path / "published").code == 0
    assert (tmp_path / "published" / "calibration" / "calibration_propcam.xml").is_file()
