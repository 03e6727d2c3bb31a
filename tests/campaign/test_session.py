"""Sessions go on from disk, never lose a good capture, and refuse what does not belong together."""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterator, Sequence
from contextlib import nullcontext
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest

from dsl_core.campaign import session as session_module
from dsl_core.campaign.assembly import accepted_calibrations, assemble, nominal_rig
from dsl_core.campaign.common.captures import read_note
from dsl_core.campaign.common.recipe import AnyRecipe, Step
from dsl_core.campaign.guide import calibrate_all, run_calibration
from dsl_core.campaign.session import CalibrationSession
from dsl_core.cli.guidance import ConsoleGuide
from dsl_core.cli.output import Output
from dsl_core.devices.base import CameraInfo, DeviceRig
from dsl_core.devices.registry import open_rig
from dsl_core.errors import CalibrationError, Cancelled, StoreError
from dsl_core.io import campaign_folder
from dsl_core.io.campaign_folder import CampaignFolder, later_than
from dsl_core.io.records import replace_record
from dsl_core.io.rig_file import load_rig, save_rig
from dsl_core.io.sealed import unseal
from dsl_core.model.calibration.accepted import AcceptedCalibration
from dsl_core.model.figure import Figure
from dsl_core.progress import NoProgress
from tests.cases.fake_recipe import FakeRecipe


def next_step(session: CalibrationSession) -> Step | None:
    """The first step without accepted captures, None when all are captured."""
    return next((each.step for each in session.statuses() if each.state != "captured"), None)


@pytest.fixture
def devices() -> Iterator[DeviceRig]:
    with open_rig("twin", {"size": "32x24", "scene": "plane"}) as rig:
        rig.place = None
        yield rig


@pytest.fixture
def campaign(tmp_path: Path) -> CampaignFolder:
    return CampaignFolder.begin(tmp_path / "campaign", "twin", {"size": "32x24", "scene": "plane"})


class Willing:
    """Places, looks and accepts whatever comes, and remembers."""

    def __init__(self, accepts: bool = True) -> None:
        self.placed: list[str] = []
        self.accepts = accepts

    def begins(self, session: CalibrationSession, missing: int) -> None:
        self.missing = missing

    def place(self, step: Step) -> None:
        self.placed.append(step.key)

    def looked(self, step: Step, figures: Sequence[Figure]) -> bool:
        return bool(figures)

    def judge(self, fitted: AcceptedCalibration) -> bool:
        return self.accepts


def another_camera(devices: DeviceRig, **changes: object) -> None:
    """Let the camera say something else of itself."""
    from dataclasses import replace

    info: CameraInfo = replace(devices.camera.info, **changes)  # type: ignore[arg-type]
    devices.camera._info = info  # type: ignore[attr-defined]


def session(devices: DeviceRig, campaign: CampaignFolder, recipe: FakeRecipe) -> CalibrationSession:
    recipes: Sequence[AnyRecipe] = (recipe,)
    return CalibrationSession(recipe, devices, campaign, recipes)


def test_steps_fit_and_acceptance_go_on_from_disk(devices: DeviceRig, campaign: CampaignFolder) -> None:
    first = session(devices, campaign, FakeRecipe())
    assert [each.state for each in first.statuses()] == ["missing", "missing"]
    assert not first.place(first.steps[0])
    first.capture(first.steps[0])
    second = session(devices, CampaignFolder.open(campaign.path), FakeRecipe())
    assert [each.state for each in second.statuses()] == ["captured", "missing"]
    assert next_step(second) == second.steps[1]
    with pytest.raises(CalibrationError, match="the step 'bright picture' is not captured"):
        second.fit()
    second.capture(second.steps[1])
    assert next_step(second) is None
    fitted = second.fit()
    assert second.accepted() is None
    third = session(devices, campaign, FakeRecipe())
    assert third.candidate() == fitted
    accepted = third.accept()
    assert third.candidate() is None
    assert third.accepted() == accepted
    assert accepted.record["means_dn"][1] > accepted.record["means_dn"][0]
    assert accepted.settings["rig"] == "twin size=32x24 scene=plane"
    assert accepted.settings["exposures"] == "5 ms at 1"
    assert accepted.conditions is not None
    assert accepted.conditions.camera.serial == devices.camera.info.serial
    assert accepted.captured


def test_the_accepted_one_before_is_history(devices: DeviceRig, campaign: CampaignFolder) -> None:
    one = session(devices, campaign, FakeRecipe())
    old = run_calibration(one, Willing(), NoProgress())
    assert run_calibration(one, Willing(), NoProgress()) == old  # complete: nothing is done again
    guide = Willing()
    new = run_calibration(one, guide, NoProgress(), redo=["dim"])
    assert guide.placed == ["dim"]
    assert campaign.history("fake") == (old,)
    assert campaign.accepted("fake") == new != old
    with pytest.raises(CalibrationError, match="has no step night; it has dim, bright"):
        run_calibration(one, guide, NoProgress(), redo=["night"])


def test_light_is_as_old_as_the_captures_that_show_it(
    devices: DeviceRig, campaign: CampaignFolder, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(FakeRecipe, "measures_light", lambda self, step: step.key == "bright")
    one = session(devices, campaign, FakeRecipe())
    old = run_calibration(one, Willing(), NoProgress())
    new = run_calibration(one, Willing(), NoProgress(), redo=["dim"])
    assert old.light == old.captured == new.note.light < new.captured
    assert run_calibration(one, Willing(), NoProgress(), redo=["bright"]).light > old.light


@pytest.mark.parametrize("clock", ["runs", "is set back"])
def test_new_captures_whose_fit_nobody_accepted_are_not_passed_over(
    devices: DeviceRig, campaign: CampaignFolder, clock: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    one = session(devices, campaign, FakeRecipe())
    old = run_calibration(one, Willing(), NoProgress())
    if clock == "is set back":
        an_hour_ago = (datetime.now(UTC) - timedelta(hours=1)).isoformat(timespec="microseconds")
        for module in (campaign_folder, session_module):
            monkeypatch.setattr(module, "now", lambda: an_hour_ago)
    with pytest.raises(CalibrationError, match="The captures are kept"):
        run_calibration(one, Willing(accepts=False), NoProgress(), redo=["dim"])
    again = session(devices, CampaignFolder.open(campaign.path), FakeRecipe())
    assert again.accepted() is None, "the fit of captures that are gone is called good"
    guide = Willing()
    new = run_calibration(again, guide, NoProgress())
    assert guide.placed == []
    assert new.captured > old.captured
    assert again.accepted() == new
    assert again.candidate() is None


def test_a_calibration_with_a_damaged_note_still_opens(devices: DeviceRig, campaign: CampaignFolder) -> None:
    one = session(devices, campaign, FakeRecipe())
    run_calibration(one, Willing(), NoProgress())
    (campaign.home("fake") / "dim" / "capture.json").write_text("{")
    again = session(devices, campaign, FakeRecipe())
    assert [each.state for each in again.statuses()] == ["refused", "captured"]
    assert again.accepted() is None


def test_a_fit_may_be_discarded_and_one_that_is_refused_waits(
    devices: DeviceRig, campaign: CampaignFolder
) -> None:
    one = session(devices, campaign, FakeRecipe(largest_dn=1.0))
    with pytest.raises(CalibrationError, match=r"brightest .* DN\. Open the aperture\."):
        run_calibration(one, Willing(accepts=False), NoProgress())
    assert one.candidate() is not None
    one.discard()
    assert one.candidate() is None
    with pytest.raises(StoreError, match="no fit of fake"):
        one.accept()
    one.fit()
    one.redo(one.steps[0])
    assert one.candidate() is None, "a fit of captures that are gone still waits"


def test_a_failing_step_is_refused_and_leaves_the_others(
    devices: DeviceRig, campaign: CampaignFolder
) -> None:
    recipe = FakeRecipe(bad_steps={"bright"})
    one = session(devices, campaign, recipe)
    one.capture(one.steps[0])
    with pytest.raises(CalibrationError, match="shows the wrong target"):
        one.capture(one.steps[1])
    assert [each.state for each in one.statuses()] == ["captured", "refused"]
    assert "wrong target" in one.statuses()[1].reason
    with pytest.raises(CalibrationError, match="'bright picture' is refused"):
        one.fit()
    recipe.bad_steps.clear()
    one.capture(one.steps[1])
    assert [each.state for each in one.statuses()] == ["captured", "captured"]


def test_redo_keeps_the_old_capture_until_the_new_one_is_complete(
    devices: DeviceRig, campaign: CampaignFolder
) -> None:
    recipe = FakeRecipe()
    one = session(devices, campaign, recipe)
    one.capture(one.steps[0])
    folder = one.bench.step_folder(one.steps[0])
    before = (folder / "scan.dsl" / "manifest.json").read_bytes()

    class Stop:
        def report(self, stage: str, done: int, total: int) -> None:
            raise Cancelled("enough")

    with pytest.raises(Cancelled):
        one.redo(one.steps[0], Stop())
    assert (folder / "scan.dsl" / "manifest.json").read_bytes() == before
    assert one.statuses()[0].state == "captured"
    # A killed process leaves the old captures aside and the new ones begun.
    aside = folder.parent / ".replaced" / folder.name
    aside.parent.mkdir(exist_ok=True)
    shutil.copytree(folder, aside)
    shutil.rmtree(folder / "scan.dsl" / "frames")
    (folder / "capture.json").unlink()
    assert session(devices, campaign, recipe).statuses()[0].state == "captured"
    assert not aside.exists()
    # Killed a moment later, the new captures are complete, and stay.
    shutil.copytree(folder, aside)
    (folder / "new").touch()
    session(devices, campaign, recipe)
    assert (folder / "new").exists()
    assert not aside.exists()


def test_damaged_captures_are_refused_and_taken_anew(devices: DeviceRig, campaign: CampaignFolder) -> None:
    one = session(devices, campaign, FakeRecipe())
    one.capture(one.steps[0])
    shutil.rmtree(one.bench.step_folder(one.steps[0]) / "scan.dsl" / "frames")
    assert one.statuses()[0].state == "refused"
    assert "zarr.json is missing" in one.statuses()[0].reason
    one.capture(one.steps[0])
    assert one.statuses()[0].state == "captured"


@pytest.mark.parametrize(
    ("change", "clause"),
    [
        ({"serial": "OTHER"}, "the camera's serial number was TWIN-C and is OTHER"),
        ({"binning": 2}, "the camera's binning was 1 and is 2"),
        ({"gain_db": 6.0}, r"the camera's gain \(dB\) was 0 and is 6"),
        ({"region_px": (0, 0, 32, 24)}, "sensor region was the whole sensor and is 0, 0, 32, 24"),
    ],
)
def test_captures_of_two_rigs_do_not_mix(
    devices: DeviceRig, campaign: CampaignFolder, change: dict[str, object], clause: str
) -> None:
    one = session(devices, campaign, FakeRecipe())
    one.capture(one.steps[0])
    another_camera(devices, **change)
    one.capture(one.steps[1])
    assert [each.state for each in one.statuses()] == ["refused", "captured"]
    with pytest.raises(CalibrationError, match=f"'dim picture' is refused .*{clause}"):
        one.fit()


def test_a_scan_copied_from_another_rig_is_found(
    devices: DeviceRig, campaign: CampaignFolder, tmp_path: Path
) -> None:
    one = session(devices, campaign, FakeRecipe())
    for step in one.steps:
        one.capture(step)
    manifest = one.bench.step_folder(one.steps[1]) / "scan.dsl" / "manifest.json"
    content = json.loads(unseal(manifest.read_bytes()))
    content["projector"]["serial"] = "another"
    manifest.write_text(json.dumps(content))
    assert one.statuses()[0].state == "captured"
    assert "the projector's serial number was another" in one.statuses()[1].reason


def chain() -> tuple[FakeRecipe, FakeRecipe]:
    return FakeRecipe("first", keys=("only",)), FakeRecipe("second", ("first",), keys=("only",), scale=3.0)


def test_all_calibrations_make_a_rig_that_says_where_it_comes_from(
    devices: DeviceRig, campaign: CampaignFolder, tmp_path: Path
) -> None:
    recipes = chain()
    with pytest.raises(CalibrationError, match="second needs first"):
        CalibrationSession(recipes[1], devices, campaign, recipes)
    rig = calibrate_all(campaign, devices, Willing(), NoProgress(), "lab 3", recipes=recipes)
    nominal = nominal_rig(devices)
    assert rig.white_scale == pytest.approx(6 * nominal.white_scale)
    assert rig.name == "lab 3"
    assert [note.name for note in rig.calibrations] == ["first", "second"]
    assert rig.calibrations[0].figures[0].std == 0.5
    assert rig.conditions is not None
    assert rig.provenance.camera_serial == "TWIN-C"
    assert load_rig(save_rig(rig, tmp_path / "rig.json")) == rig
    assert [recipe.done_before for recipe in recipes] == [(), ("first",)]
    # Nothing is captured or fitted a second time.
    captured = [list(recipe.captured) for recipe in recipes]
    calibrate_all(campaign, devices, Willing(), NoProgress(), recipes=recipes)
    assert [recipe.captured for recipe in recipes] == captured


@pytest.mark.parametrize(("bits", "black_dn"), [(12, 260.0), (10, 0.0)])
def test_the_black_level_of_another_bit_depth_is_not_believed(
    devices: DeviceRig, bits: int, black_dn: float
) -> None:
    assert devices.nominal is not None
    stated = devices.nominal.sensor.model_copy(update={"bit_depth": bits, "black_level_dn": 260.0})
    known = replace(devices, nominal=devices.nominal.model_copy(update={"sensor": stated}))
    assert nominal_rig(known).sensor.bit_depth == devices.camera.info.bit_depth == 12
    assert nominal_rig(known).sensor.black_level_dn == black_dn


def test_what_was_fitted_on_a_superseded_calibration_is_fitted_again(
    devices: DeviceRig, campaign: CampaignFolder
) -> None:
    recipes = chain()
    calibrate_all(campaign, devices, Willing(), NoProgress(), recipes=recipes)
    old = campaign.accepted("second")
    first = CalibrationSession(recipes[0], devices, campaign, recipes)
    run_calibration(first, Willing(), NoProgress(), redo=["only"])
    assert CalibrationSession(recipes[1], devices, campaign, recipes).accepted() is None
    guide = Willing()
    calibrate_all(campaign, devices, guide, NoProgress(), recipes=recipes)
    assert guide.placed == []
    new = campaign.accepted("second")
    assert old is not None
    assert new is not None
    assert new.based_on != old.based_on
    assert new.record == old.record


def test_other_settings_are_fitted_again_from_the_same_captures(
    devices: DeviceRig, campaign: CampaignFolder
) -> None:
    recipe = FakeRecipe()
    old = run_calibration(session(devices, campaign, recipe), Willing(), NoProgress())
    captured = list(recipe.captured)
    other = campaign.with_settings("fake", {"largest_dn": "3000"})
    assert session(devices, other, recipe).accepted() is None
    new = run_calibration(session(devices, other, recipe), Willing(), NoProgress())
    assert recipe.captured == captured
    assert new.accepted > old.accepted
    assert new.settings["largest_dn"] == "3000"
    assert session(devices, other, recipe).accepted() == new


def test_a_setting_that_only_captures_heed_is_told_until_they_are_made_with_it(
    devices: DeviceRig, campaign: CampaignFolder, capsys: pytest.CaptureFixture[str]
) -> None:
    run_calibration(session(devices, campaign, FakeRecipe()), Willing(), NoProgress())
    other = campaign.with_settings("fake", {"level": "0.5"})
    changed = session(devices, other, FakeRecipe(level=0.5))
    dim, bright = changed.statuses()
    assert (dim.state, dim.reason) == ("captured", "")
    assert bright.state == "captured"
    assert bright.reason == "it was captured with level=1; other values act on new captures only"
    ConsoleGuide(Output(as_json=False), None).begins(changed, 0)
    assert f"  bright picture: {bright.reason} (--redo bright)\n" in capsys.readouterr().out
    run_calibration(changed, Willing(), NoProgress(), redo=["bright"])
    assert [each.reason for each in changed.statuses()] == ["", ""]
    assert (
        session(devices, other, FakeRecipe())
        .statuses()[1]
        .reason.startswith("it was captured with level=0.5")
    )


def test_captures_of_earlier_versions_are_not_said_to_lack_settings(
    devices: DeviceRig, campaign: CampaignFolder
) -> None:
    run_calibration(session(devices, campaign, FakeRecipe()), Willing(), NoProgress())
    for path in campaign.path.rglob(campaign_folder.NOTE_NAME):
        note = read_note(path.parent)
        assert note is not None
        replace_record(path, note.model_copy(update={"settings": {}}))
    changed = session(devices, campaign, FakeRecipe(level=0.5))
    assert [(each.state, each.reason) for each in changed.statuses()] == [("captured", "")] * 2


def test_files_that_say_something_else_now_are_fitted_again(
    devices: DeviceRig, campaign: CampaignFolder, monkeypatch: pytest.MonkeyPatch
) -> None:
    recipe = FakeRecipe()
    old = run_calibration(session(devices, campaign, recipe), Willing(), NoProgress())
    captured, asked = list(recipe.captured), list[object]()
    monkeypatch.setattr(FakeRecipe, "is_current", lambda _, record: asked.append(record))
    assert session(devices, campaign, recipe).accepted() is None
    assert asked == [old.record]
    assert (
        run_calibration(session(devices, campaign, recipe), Willing(), NoProgress()).accepted > old.accepted
    )
    assert recipe.captured == captured


def test_nothing_is_calibrated_on_what_another_rig_was_captured_with(
    devices: DeviceRig, campaign: CampaignFolder
) -> None:
    recipes = chain()
    run_calibration(CalibrationSession(recipes[0], devices, campaign, recipes), Willing(), NoProgress())
    another_camera(devices, serial="B")
    with pytest.raises(CalibrationError, match=r"first was captured .* number was TWIN-C and is B"):
        CalibrationSession(recipes[1], devices, campaign, recipes)
    run_calibration(CalibrationSession(recipes[0], devices, campaign, recipes), Willing(), NoProgress())
    assert next_step(CalibrationSession(recipes[1], devices, campaign, recipes)) is not None


def test_accepted_calibrations_of_two_rigs_are_not_assembled(
    devices: DeviceRig, campaign: CampaignFolder
) -> None:
    recipes = chain()
    calibrate_all(campaign, devices, Willing(), NoProgress(), recipes=recipes)
    accepted = dict(accepted_calibrations(campaign, recipes))
    assert accepted["second"].conditions is not None
    lens = accepted["second"].conditions.camera.model_copy(update={"gain_db": 3.0})
    other = accepted["second"].conditions.model_copy(update={"camera": lens})
    accepted["second"] = accepted["second"].model_copy(update={"conditions": other})
    with pytest.raises(CalibrationError, match="first and second were captured with different"):
        assemble(accepted, nominal_rig(devices), recipes)
    partial = assemble({"first": accepted["first"]}, nominal_rig(devices), recipes)
    assert partial.provenance.notes == "Not calibrated, as nominal: second."
    with pytest.raises(CalibrationError, match="needs first"):
        assemble({"second": accepted["second"]}, nominal_rig(devices), recipes)
    with pytest.raises(CalibrationError, match="No calibration has been accepted"):
        assemble({}, nominal_rig(devices), recipes)


def test_a_damaged_record_and_a_foreign_folder_are_named(
    devices: DeviceRig, campaign: CampaignFolder, tmp_path: Path
) -> None:
    recipes = chain()
    calibrate_all(campaign, devices, Willing(), NoProgress(), recipes=recipes)
    path = campaign.path / "first.json"
    content = json.loads(unseal(path.read_bytes()))
    content["record"] = {"means_dn": "many"}
    path.write_text(json.dumps(content))
    with pytest.raises(CalibrationError, match=r"first of .* another version \(means_dn"):
        CalibrationSession(recipes[1], devices, campaign, recipes)
    path.write_text(path.read_text()[:50])
    with pytest.raises(StoreError, match=r"first\.json is damaged"):
        CalibrationSession(recipes[1], devices, campaign, recipes)
    (tmp_path / "unborn").mkdir()
    (tmp_path / "unborn" / "lock").touch()
    assert CampaignFolder.begin(tmp_path / "unborn", None, {}).info.rig == "twin"
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "thing").touch()
    with pytest.raises(StoreError, match="neither empty nor a campaign"):
        CampaignFolder.begin(tmp_path / "full", None, {})
    with pytest.raises(StoreError, match="begun with the rig twin scene=plane size=32x24"):
        CampaignFolder.begin(campaign.path, None, {"size": "64x48"})
    kept = CampaignFolder.begin(campaign.path, None, {}, {"first": {"keys": "a,b"}})
    assert kept.info.settings == {"first": {"keys": "a,b"}}


class Placer:
    """A rig's own hand, which notes what it was asked."""

    def __init__(self) -> None:
        self.done: list[str] = []

    def place(self, placement: object) -> None:
        self.done.append("place")

    def put_back(self) -> None:
        self.done.append("put back")

    def standing(self) -> str:
        return "target" if self.done[-1:] == ["place"] else "scene"


def test_a_rig_that_places_targets_puts_back_what_was_there(
    devices: DeviceRig, campaign: CampaignFolder
) -> None:
    for accepts in (False, True):
        hand = Placer()
        devices.place, devices.put_back = hand.place, hand.put_back
        with nullcontext() if accepts else pytest.raises(CalibrationError):
            calibrate_all(campaign, devices, Willing(accepts=accepts), NoProgress(), recipes=chain())
        assert hand.done[0] == "place"
        assert hand.done.count("put back") == 1
        assert hand.done[-1] == "put back"


def test_a_target_is_placed_again_before_it_is_captured(devices: DeviceRig, campaign: CampaignFolder) -> None:
    hand = Placer()
    devices.place, devices.put_back, devices.standing = hand.place, hand.put_back, hand.standing
    one = session(devices, campaign, FakeRecipe())
    one.place(one.steps[0])
    one.look(one.steps[0])
    assert hand.done == ["place"]
    hand.put_back()  # as a scan does that comes between
    one.capture(one.steps[0])
    assert hand.done == ["place", "put back", "place"]


def test_a_time_is_later_than_one_before_whatever_the_clock_says() -> None:
    before = "2999-03-01T10:20:30.999999+00:00"
    assert later_than(before) == "2999-03-01T10:20:31.000000+00:00"
    assert later_than("") > "2026"
    assert later_than("no time") > "2026"
    assert later_than("2026-03-01T10:20:30.000400+00:00") > "2026-03-01T10:20:30.000400+00:00"
