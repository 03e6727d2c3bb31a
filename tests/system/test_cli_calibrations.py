"""The library on the command line: listed, shown, brought back, handed on, checked."""

from __future__ import annotations

from pathlib import Path

import pytest

from dsl_core.devices.conditions import current_conditions
from dsl_core.devices.registry import open_rig
from dsl_core.io.calibration_library import CalibrationLibrary
from dsl_core.io.rig_file import load_rig, save_rig
from dsl_core.model.calibration.accepted import CalibrationNote
from dsl_core.model.figure import Figure
from dsl_core.model.rig import Provenance, Rig

from .conftest import Give

PLANE = ["-O", "size=112x72", "-O", "scene=plane"]


@pytest.fixture
def library(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> CalibrationLibrary:
    monkeypatch.setenv("DSL_SCAN_HOME", str(tmp_path / "home"))
    return CalibrationLibrary()


def calibrated(white_scale: float = 1.0) -> Rig:
    with open_rig("twin", {"size": "112x72", "scene": "plane"}) as devices:
        assert devices.calibration is not None
        rig = devices.calibration
        figure = Figure(name="rms", value=0.4, std=0.1, unit="px", high=0.3, advice="Repeat it.")
        note = CalibrationNote(name="geometry", title="Geometry", accepted="2026-01-01", figures=(figure,))
        update = {
            "conditions": current_conditions(devices),
            "calibrations": (note,),
            "white_scale": rig.white_scale * white_scale,
        }
        return rig.model_copy(update=update)


def test_versions_are_listed_shown_and_brought_back(
    give: Give, tmp_path: Path, library: CalibrationLibrary
) -> None:
    assert "is empty" in give("calibrations", "list").out
    old, new = library.store("lab", calibrated()), library.store("lab", calibrated(2.0))
    damaged = library.store("worn", calibrated())
    path = library.home / "worn" / "versions" / f"{damaged.stamp}.json"
    path.write_text(path.read_text()[:40])
    listed = give("calibrations", "list").out
    assert "rms 0.40 ± 0.10 px" in listed
    assert "damaged: " in listed
    entries = give("calibrations", "list", "--json").json["calibrations"]
    assert [entry["current"] for entry in entries] == [True, False, True]
    assert entries[0]["figures"]["geometry"][0]["passed"] is False

    shown = give("calibrations", "show", "lab", "--report", tmp_path / "lab.html")
    assert "camera: model" in shown.out
    assert "missed: Repeat it." in shown.out
    assert (tmp_path / "lab.html").is_file()
    assert give("calibrations", "restore", "lab", old.stamp, "--json").json["version"] == old.stamp
    assert library.find("lab") == old
    assert library.stamps("lab") == (old.stamp, new.stamp)
    assert "has no version 1999" in give("calibrations", "restore", "lab", "1999").sentence
    assert "is damaged" in give("calibrations", "show", "worn").sentence


def test_a_calibration_travels(give: Give, tmp_path: Path, library: CalibrationLibrary) -> None:
    entry = library.store("lab", calibrated())
    assert give("calibrations", "export", "lab", tmp_path / "lab.json").code == 0
    assert "already exists" in give("calibrations", "export", "lab", tmp_path / "lab.json").sentence
    assert give("calibrations", "export", "lab", tmp_path / "rig.json", "--form", "rig").code == 0
    assert load_rig(tmp_path / "rig.json") == entry.rig
    published = give("calibrations", "export", "lab", tmp_path / "out", "--form", "published", "--json")
    assert any(file.endswith("calibration_propcam.xml") for file in published.json["files"])
    assert "--form must be" in give("calibrations", "export", "lab", tmp_path / "x", "--form", "pdf").sentence
    assert give("calibrations", "import", tmp_path / "lab.json", "--name", "copy").code == 0
    assert library.find("copy").rig == entry.rig
    assert give("calibrations", "import", tmp_path / "rig.json", "--name", "bare").code == 0
    assert library.find("bare").rig == entry.rig


@pytest.mark.slow
def test_a_quick_shot_says_whether_the_rig_has_changed(
    give: Give, library: CalibrationLibrary, tmp_path: Path
) -> None:
    library.store("lab", calibrated())
    ending = give("calibrations", "check", "lab", "--yes", *PLANE, "--json")
    assert ending.code == 0, ending.err
    assert ending.json["stable"] is True
    assert len(ending.json["figures"]) == 9
    assert ending.json["kept"] is True, "although nobody noted when this light was calibrated"
    path = save_rig(calibrated(), tmp_path / "rig.json")
    assert "is a file and does not remember" in give("calibrations", "check", path, "--yes", *PLANE).out
    library.store("lab", calibrated(1.1))
    dated = calibrated(1.1).model_copy(update={"provenance": Provenance(created="2026-03-01")})
    library.store("lab", dated)
    ending = give("calibrations", "check", "lab", "--yes", *PLANE)
    assert ending.code == 2
    assert "The rig no longer matches lab: white signal, red" in ending.sentence
    assert "lab now remembers this check" in ending.out
    (found,) = library.find("lab").rig.light_checks
    assert found.largest_change == pytest.approx(1 / 1.1 - 1, abs=0.01)
