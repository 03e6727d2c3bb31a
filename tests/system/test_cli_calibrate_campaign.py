"""Calibrations as commands: prompts, interruptions, verdicts, and the rig that comes out."""

from __future__ import annotations

import io
import json
from pathlib import Path

import pytest

from dsl_core.campaign import recipes
from dsl_core.campaign.common.recipe import Bench, Step
from dsl_core.devices import registry
from dsl_core.devices.base import DeviceRig
from dsl_core.errors import CalibrationError
from dsl_core.io.calibration_library import CalibrationLibrary
from dsl_core.io.rig_file import load_rig
from dsl_core.io.scan.folder import ScanReader
from dsl_core.io.sealed import unseal
from dsl_core.model.calibration.light_check import LightCheck
from dsl_core.reconstruction.spectral import rig_traits
from tests.cases import fake_recipe

from .conftest import Give

TWIN = ["-O", "size=32x24", "-O", "scene=plane"]


@pytest.fixture(autouse=True)
def _two_calibrations(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A self-test and a geometry that need no targets, an own library, and nobody at the keyboard."""
    known = {"selftest": "FakeSelfTest", "geometry": "FakeGeometry"}
    monkeypatch.setattr(recipes, "_CLASSES", known)
    monkeypatch.setattr(recipes, "_module", lambda name: fake_recipe.__name__)
    monkeypatch.setenv("DSL_SCAN_HOME", str(tmp_path / "home"))
    monkeypatch.setattr("sys.stdin", io.StringIO(""))


@pytest.fixture
def by_hand(monkeypatch: pytest.MonkeyPatch) -> None:
    """A rig that cannot place targets itself."""
    opened = registry.open_rig

    def open_rig(name: str, options: dict[str, str] | None = None) -> DeviceRig:
        rig = opened(name, options)
        rig.place = None
        return rig

    monkeypatch.setattr(registry, "open_rig", open_rig)


def test_in_what_a_rig_is_unlike_the_usual_is_said(
    give: Give, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(rig_traits, "_traits", lambda rig: iter(("a film is bent", "light is uneven")))
    ending = give("calibrate", "all", tmp_path / "a", *TWIN, "--yes", "--no-library")
    assert "Measured by the calibration, and followed: a film is bent; light is uneven." in ending.out
    again = give("calibrate", "all", tmp_path / "a", "--yes", "--no-library", "--json").json
    assert again["traits"] == ["a film is bent", "light is uneven"]


@pytest.mark.slow
def test_one_command_makes_a_rig_a_report_and_a_library_entry(give: Give, tmp_path: Path) -> None:
    folder, setting = tmp_path / "campaign", "geometry.scale=1.5"
    ending = give("calibrate", "all", folder, *TWIN, "--yes", "--name", "lab 3", "--set", setting, "--json")
    assert ending.code == 0, ending.err
    rig = load_rig(folder / "rig.json")
    assert [note.name for note in rig.calibrations] == ["selftest", "geometry"]
    assert rig.name == "lab 3"
    with registry.open_rig("twin", {"size": "32x24"}) as devices:
        assert devices.nominal is not None
        assert rig.white_scale == pytest.approx(2 * 1.5 * devices.nominal.white_scale)
    assert ending.json["library"] == "lab 3"
    assert ending.json["figures"]["geometry"][0]["name"] == "brightest"
    assert [stage["name"] for stage in ending.json["stages"]] == ["Brightness", "Brightness"]
    assert "Calibration of lab 3" in (folder / "report.html").read_text()
    assert CalibrationLibrary().find("lab 3").rig == rig
    info = give("info", folder, "--json").json
    assert info["kind"] == "campaign"
    assert list(info["accepted"]) == ["geometry", "selftest"]
    # A second time nothing is captured, and the library gets no second version.
    before = (folder / "geometry" / "pose" / "capture.json").stat().st_mtime_ns
    again = give("calibrate", "all", folder, "--yes", "--name", "lab 3")
    assert again.code == 0
    assert "scan SCAN.dsl --calibration 'lab 3'" in " ".join(again.out.split())
    assert (folder / "geometry" / "pose" / "capture.json").stat().st_mtime_ns == before
    assert len(CalibrationLibrary().stamps("lab 3")) == 1
    # Nor does it for what a drift check has found of the light since.
    check = LightCheck(checked="2026-03-22", calibrated="2026-03-01", levels=(1.0, 1.0, 1.0))
    CalibrationLibrary().store("lab 3", rig.model_copy(update={"light_checks": (check,)}))
    assert give("calibrate", "all", folder, "--yes", "--name", "lab 3").code == 0
    assert CalibrationLibrary().find("lab 3").rig.light_checks == (check,)
    assert len(CalibrationLibrary().stamps("lab 3")) == 2
    scan = [
        "scan",
        tmp_path / "a.dsl",
        *TWIN,
        "--code",
        "columns",
        "--lines",
        "64x64",
        "--calibration",
        "lab 3",
    ]
    assert give(*scan).code == 0
    assert ScanReader(tmp_path / "a.dsl").calibration == CalibrationLibrary().find("lab 3").rig


def test_a_late_refusal_leaves_the_rig_as_calibrated_so_far(give: Give, tmp_path: Path) -> None:
    folder = tmp_path / "campaign"
    ending = give("calibrate", "all", folder, *TWIN, "--yes", "--set", "geometry.largest_dn=0")
    assert (ending.code, "was not accepted: brightest" in ending.sentence) == (2, True)
    assert [note.name for note in load_rig(folder / "rig.json").calibrations] == ["selftest"]
    assert "The rig as calibrated so far is saved in" in ending.out
    assert CalibrationLibrary().names() == ()


@pytest.mark.parametrize(("folder", "named"), [("lab (1)", []), ("lab", ["--name", "lab/1"])])
def test_a_name_that_the_library_cannot_take_is_told_before_anything_is_captured(
    give: Give, tmp_path: Path, folder: str, named: list[str]
) -> None:
    ending = give("calibrate", "all", tmp_path / folder, *TWIN, "--yes", *named)
    assert (ending.code, "A calibration cannot be named 'lab" in ending.sentence) == (2, True)
    assert not (tmp_path / folder).exists()


def test_an_interrupted_campaign_goes_on(give: Give, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder, capture = tmp_path / "campaign", fake_recipe.FakeRecipe.capture

    def stop(self: fake_recipe.FakeRecipe, *arguments: object) -> None:
        if self.captured:
            raise KeyboardInterrupt
        capture(self, *arguments)  # type: ignore[arg-type]

    monkeypatch.setattr(fake_recipe.FakeRecipe, "capture", stop)
    ending = give("calibrate", "all", folder, *TWIN, "--yes")
    assert ending.code == 130
    assert f"Resume with: dsl-scan calibrate all {folder}" in ending.sentence
    first = (folder / "selftest" / "dim" / "scan.dsl" / "manifest.json").stat().st_mtime_ns
    monkeypatch.setattr(fake_recipe.FakeRecipe, "capture", capture)
    ending = give("calibrate", "all", folder, "--yes", "--json")
    assert ending.code == 0, ending.err
    assert (folder / "selftest" / "dim" / "scan.dsl" / "manifest.json").stat().st_mtime_ns == first
    assert ending.json["library"] == "campaign"


@pytest.mark.usefixtures("by_hand")
def test_a_person_is_asked_to_place_and_to_look_again(
    give: Give, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "campaign"
    ending = give("selftest", folder, *TWIN)
    assert ending.code == 2
    assert "Place the dim target. Then press Enter" in ending.err
    assert "There is no answer" in ending.err
    monkeypatch.setattr("sys.stdin", io.StringIO("\n\n\n\ngo\n"))
    ending = give("selftest", folder, *TWIN, "--set", "good_look=4", "--json")
    assert ending.code == 0, ending.err
    # Enter for the first target and two more looks; by the second look at the second target it is right.
    assert ending.err.count("Move the target closer. Press Enter to look again") == 3
    assert ending.json["name"] == "selftest"


def test_figures_outside_their_limits_end_in_what_to_do(give: Give, tmp_path: Path) -> None:
    assert give("selftest", *TWIN, "--yes").code == 0
    bad = ["selftest", tmp_path / "campaign", *TWIN, "--yes", "--set", "largest_dn=1"]
    ending = give(*bad)
    assert ending.code == 2
    assert "was not accepted: brightest" in ending.sentence
    assert "Open the aperture" in ending.sentence
    assert "missed: Open the aperture." in ending.out
    assert "needs selftest" in give("calibrate", "geometry", tmp_path / "campaign", "--yes").sentence
    assert "calibrate selftest" not in ending.sentence
    assert "The captures are kept" in ending.sentence
    spare = give("selftest", *TWIN, "--yes", "--set", "largest_dn=1")
    assert spare.sentence.endswith("Then run the command again.")
    assert "kept" not in spare.sentence
    look = give("selftest", tmp_path / "other", *TWIN, "--yes", "--set", "good_look=9")
    assert "The step 'dim picture' does not look right" in look.sentence
    assert give("calibrate", "all", tmp_path / "campaign", "--yes", "--accept-failed").code == 0


def test_steps_are_captured_anew_on_request(give: Give, tmp_path: Path) -> None:
    folder = tmp_path / "campaign"
    assert give("calibrate", "all", folder, *TWIN, "--yes", "--no-library").code == 0
    assert CalibrationLibrary().names() == ()
    ending = give("calibrate", "geometry", folder, "--yes")
    assert "was accepted before" in ending.out
    assert give("calibrate", "geometry", folder, "--yes", "--redo", "pose").code == 0
    assert len(list((folder / "history" / "geometry").iterdir())) == 1
    assert "has no step night" in give("calibrate", "geometry", folder, "--redo", "night").sentence
    assert "Replaced calibrations" not in (folder / "report.html").read_text()
    assert give("calibrate", "all", folder, "--yes").code == 0
    assert "Replaced calibrations" in (folder / "report.html").read_text()


def test_a_setting_that_the_devices_refuse_is_not_kept(
    give: Give, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder, steps = tmp_path / "campaign", fake_recipe.FakeRecipe.steps

    def within_reach(recipe: fake_recipe.FakeRecipe, bench: Bench) -> tuple[Step, ...]:
        if recipe.scale > 100:
            raise CalibrationError("The stage does not reach there.")
        return steps(recipe, bench)

    monkeypatch.setattr(fake_recipe.FakeRecipe, "steps", within_reach)
    refused = give("selftest", folder, *TWIN, "--yes", "--set", "scale=200")
    assert refused.code != 0
    assert "does not reach there" in refused.sentence
    assert give("selftest", folder, *TWIN, "--yes").code == 0


def test_captures_of_another_rig_are_named(give: Give, tmp_path: Path) -> None:
    folder = tmp_path / "campaign"
    assert give("selftest", folder, *TWIN, "--yes").code == 0
    path = folder / "selftest.json"
    content = json.loads(unseal(path.read_bytes()))
    content["conditions"]["camera"]["serial"] = "A"
    path.write_text(json.dumps(content))
    ending = give("calibrate", "all", folder, "--yes")
    assert "The calibration selftest was captured with other devices or settings" in ending.sentence
    assert "the camera's serial number was A and is TWIN-C" in ending.sentence


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["selftest", "--set", "colour=1"], "selftest has no setting colour; it has"),
        (
            ["selftest", "--set", "good_look=many"],
            "setting of selftest is wrong: good_look must be",
        ),
        (["selftest", "c", "--rig", "nothing"], "There is no rig 'nothing'"),
        (["selftest", "c", "-O", "size=1x1"], "The twin's size must be"),
        (["calibrate", "geometry", "c", "--output", "x.json"], "--hold and --camera-only need --pictures"),
        (["calibrate", "geometry", "c", "--board", "9x7"], "A board needs both"),
        (["calibrate", "all", "c", "--set", "scale=3"], "like bandpass.line_px=5, not scale=3"),
        (["calibrate", "all", "c", "--set", "geometry.colour=3"], "geometry has no setting colour"),
        (["calibrate", "bandpass", "c"], "There is no calibration 'bandpass'; choose selftest, geometry"),
    ],
)
def test_wrong_words_are_told_and_leave_nothing(
    give: Give, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arguments: list[str], sentence: str
) -> None:
    monkeypatch.chdir(tmp_path)
    ending = give(*arguments)
    assert ending.code == 2
    assert sentence in ending.sentence
    assert "captured is kept" not in ending.sentence, "nothing was captured"
    assert not (tmp_path / "c").exists()
