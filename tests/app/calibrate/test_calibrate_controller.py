from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from datetime import timedelta
from pathlib import Path

import pytest
from dsl_app.calibrate.campaign_status import key_figure
from dsl_app.calibrate.controller import library_name
from dsl_app.calibrate.state import RowState
from dsl_app.calibrate.wizard.state import Doing, Fit, WizardState
from dsl_app.connection.state import RigChoice
from dsl_app.shared.evented import Value
from dsl_app.shared.jobs.base import Job

from dsl_core.devices.base import DeviceRig
from dsl_core.devices.conditions import current_conditions
from dsl_core.errors import CalibrationError, DeviceError, StoreError
from dsl_core.io.calibration_library import CalibrationLibrary
from dsl_core.io.campaign_folder import CampaignFolder
from dsl_core.io.rig_file import load_rig
from dsl_core.io.scan.lock import FolderLock
from dsl_core.model.calibration.accepted import AcceptedCalibration
from dsl_core.model.figure import Figure
from dsl_core.model.frames import Frame
from dsl_core.model.placement import Placement
from dsl_core.simulation.sim_devices import SimCamera
from tests.app.calibrate.calibrate_bench import CalibrateBench, make_bench, with_a_campaign
from tests.app.support.doubles import InlineRunner


@pytest.fixture
def bench(tmp_path: Path) -> CalibrateBench:
    return with_a_campaign(make_bench(tmp_path))


def calibrate(bench: CalibrateBench, name: str) -> None:
    """Go through a whole wizard as a person does."""
    state, control = bench.wizard(name)
    while state.lacking:
        control.go_to(state.lacking[0])
        control.capture()
        assert not state.trouble.value
    control.fit()
    control.accept()
    control.leave()


def fit_of(state: WizardState) -> Fit | None:
    return state.fit.value


def is_on(value: Value[bool]) -> bool:
    return value.value


def page(state: WizardState) -> int:
    return state.at.value


def states(bench: CalibrateBench) -> list[RowState]:
    return [row.state for row in bench.state.rows.value]


def test_a_wizard_goes_from_placement_to_acceptance_and_writes_the_rig(bench: CalibrateBench) -> None:
    assert states(bench) == [RowState.MISSING, RowState.MISSING]
    state, control = bench.wizard("selftest")
    assert page(state) == 0
    assert state.title == "Self-test"
    control.go_to(1)
    assert not state.is_checking.value, "a person has not placed the target yet"
    control.check(True)
    assert state.look.value is not None
    assert state.look.value.is_good
    control.capture()
    control.take_news()
    assert state.seen.value is not None
    assert state.seen.value.picture.shape == (12, 16, 3)
    assert state.note.value == "dim picture is captured. 1 to go."
    assert page(state) == 2
    control.capture()
    assert state.note.value == "bright picture is captured. All steps are captured: fit them."
    assert page(state) == state.last == 3
    control.fit()
    found = fit_of(state)
    assert found is not None
    assert not found.is_accepted
    control.accept()
    found = fit_of(state)
    assert found is not None
    assert found.is_accepted
    assert (bench.campaign / "report.html").is_file()
    rig = load_rig(bench.campaign / "rig.json")
    assert rig.provenance.notes == "Not calibrated, as nominal: geometry."
    assert bench.library.names() == (), "a rig that is half calibrated is kept only on request"
    control.leave()
    assert states(bench) == [RowState.GOOD, RowState.MISSING]
    figure = bench.row("selftest").figure
    assert figure is not None
    assert figure.name == "brightest"
    calibrate(bench, "geometry")
    assert states(bench) == [RowState.GOOD, RowState.GOOD]
    assert bench.state.is_complete
    assert bench.library.names() == ("campaign",)
    assert [line.name for line in bench.state.library.value] == ["campaign"]


def test_a_wizard_goes_on_where_it_was_left(bench: CalibrateBench) -> None:
    state, control = bench.wizard("selftest")
    control.go_to(1)
    control.capture()
    control.leave()
    assert bench.row("selftest").state is RowState.BEGUN
    assert bench.row("selftest").reason == "1 captured"
    state, control = bench.wizard("selftest")
    assert page(state) == 2
    assert [each.state for each in state.statuses.value] == ["captured", "missing"]
    control.capture()
    control.fit()
    control.leave()
    assert bench.row("selftest").has_candidate
    state, control = bench.wizard("selftest")
    assert page(state) == state.last
    assert fit_of(state) is not None
    control.discard()
    assert fit_of(state) is None
    control.leave()
    assert bench.row("selftest").state is RowState.BEGUN
    assert not bench.row("selftest").has_candidate


def test_redoing_a_step_forgets_the_fit_and_keeps_what_was_accepted(bench: CalibrateBench) -> None:
    calibrate(bench, "selftest")
    state, control = bench.wizard("selftest")
    found = fit_of(state)
    assert found is not None
    assert found.is_accepted
    control.go_to(1)
    control.capture()
    assert fit_of(state) is None
    control.leave()
    assert bench.row("selftest").state is RowState.GOOD


def test_a_look_that_is_not_good_advises_and_repeats(bench: CalibrateBench) -> None:
    bench.wrong = {"good_look": 3}
    state, control = bench.wizard("selftest")
    control.go_to(1)
    control.check(True)
    look = state.look.value
    assert look is not None
    assert not look.is_good
    assert look.figures[0].advice == "Move the target closer."
    control._looked_at -= 10.0
    control.take_news()
    assert state.look.value is not look
    control.check(False)
    now = state.look.value
    control._looked_at -= 10.0
    control.take_news()
    assert state.look.value is now, "it looked although nobody wants it to"


def test_a_step_that_shows_something_wrong_is_named_and_others_stay(bench: CalibrateBench) -> None:
    bench.wrong = {"bad_steps": {"bright"}}
    state, control = bench.wizard("selftest")
    for step in (1, 2):
        control.go_to(step)
        control.capture()
    assert "shows the wrong target" in state.trouble.value
    assert [each.state for each in state.statuses.value] == ["captured", "refused"]
    assert page(state) == 2
    control.fit()
    assert "'bright picture' is refused" in state.trouble.value
    bench.wrong = {}
    control.leave()
    state, control = bench.wizard("selftest")
    control.capture()
    assert not state.lacking


def test_a_lost_camera_is_a_sentence_and_the_rig_can_be_connected_again(
    bench: CalibrateBench, monkeypatch: pytest.MonkeyPatch
) -> None:
    state, control = bench.wizard("selftest")
    control.go_to(1)

    def silent(self: SimCamera, timeout_ms: float = 0.0) -> Frame:
        raise DeviceError("The camera sent no frame. Check its cable.")

    with monkeypatch.context() as lost:
        lost.setattr(SimCamera, "snap", silent)
        control.capture()
    assert "Check its cable" in state.trouble.value
    assert is_on(state.can_reconnect)
    before = bench.rig.state.devices.value
    control.reconnect()
    assert bench.rig.state.devices.value is not before
    assert not is_on(state.can_reconnect)
    assert page(state) == 1
    control.capture()
    assert not state.trouble.value
    assert state.statuses.value[0].state == "captured"


def test_a_full_disk_costs_nothing_captured(bench: CalibrateBench, monkeypatch: pytest.MonkeyPatch) -> None:
    state, control = bench.wizard("selftest")
    control.go_to(1)
    control.capture()
    with monkeypatch.context() as full:

        def no_room(*_: object) -> None:
            raise StoreError("The disk is full: free some space and resume.")

        full.setattr("dsl_core.campaign.session.write_note", no_room)
        control.capture()
    assert "The disk is full" in state.trouble.value
    assert not state.can_reconnect.value
    assert [each.state for each in state.statuses.value] == ["captured", "missing"]
    control.capture()
    assert not state.lacking


def test_settings_are_kept_when_right_and_refused_when_wrong(bench: CalibrateBench) -> None:
    state, control = bench.wizard("selftest")
    assert {row.key: row.value for row in state.settings.value}["scale"] == "2"
    control.change_settings({"scale": "large"})
    assert "The setting scale of selftest is wrong" in state.settings_trouble.value
    assert CampaignFolder.open(bench.campaign).info.settings == {}
    control.change_settings({"scale": "3", "keys": "one,two,three"})
    assert not state.settings_trouble.value
    assert [each.step.key for each in state.statuses.value] == ["one", "two", "three"]
    assert CampaignFolder.open(bench.campaign).info.settings == {
        "selftest": {"scale": "3", "keys": "one,two,three"}
    }
    control.change_settings({"scale": "2", "keys": "dim,bright"})
    assert CampaignFolder.open(bench.campaign).info.settings == {}


def test_settings_requested_by_the_evidence_fit_again(bench: CalibrateBench) -> None:
    state, control = bench.wizard("selftest")
    for step in (1, 2):
        control.go_to(step)
        control.capture()
    control.fit()
    first = fit_of(state)
    control.change_settings({"largest_dn": "1"}, then_fit=True)
    found = fit_of(state)
    assert found is not None
    assert found is not first
    assert found.fitted.figures[0].high == 1.0
    assert found.fitted.settings["largest_dn"] == "1"
    control.change_settings({"largest_dn": "much"}, then_fit=True)
    assert "largest_dn" in state.trouble.value


def test_a_fit_that_fails_leaves_its_captures_to_be_looked_at(bench: CalibrateBench) -> None:
    def fails(bench: object, progress: object) -> None:
        raise CalibrationError("No target was found. Set its corners.")

    bench.wrong = {"fit": fails}
    state, control = bench.wizard("selftest")
    for step in (1, 2):
        control.go_to(step)
        control.capture()
    control.fit()
    assert state.trouble.value == "No target was found. Set its corners."
    assert state.misfit.value is not None
    assert [step.key for step in state.misfit.value.steps] == ["dim", "bright"]
    bench.wrong = {}
    control.change_settings({"largest_dn": "4095"}, then_fit=True)
    assert fit_of(state) is not None
    assert state.misfit.value is None


def test_a_rig_that_places_targets_captures_all_steps_by_itself(bench: CalibrateBench) -> None:
    devices = bench.rig.state.devices.value
    assert devices is not None
    placed: list[Placement] = []
    devices.place = placed.append
    state, control = bench.wizard("selftest")
    control.go_to(1)
    assert state.is_checking.value, "the rig placed the target, so it can be looked at"
    control.capture_all()
    assert len(placed) == 2
    assert not state.lacking
    assert fit_of(state) is not None
    assert not state.is_automatic.value
    control.leave()
    bench.wrong = {"good_look": 99}
    state, control = bench.wizard("selftest")
    control.change_settings({"keys": "night"})
    control.capture_all()
    assert "'night picture' does not look right" in state.trouble.value


def test_everything_runs_in_order_and_stops_with_the_reason(bench: CalibrateBench) -> None:
    bench.control.run_everything()
    assert "cannot place its targets itself" in bench.told
    devices = bench.rig.state.devices.value
    assert devices is not None
    devices.place = lambda placement: None
    bench.wrong = {"largest_dn": 1.0}
    bench.control.run_everything()
    assert "Brightness is outside its limits" in bench.told
    assert "Open the aperture." in bench.told
    assert bench.row("selftest").has_candidate
    bench.wrong = {}
    bench.control.run_everything()
    assert "Everything is calibrated" in bench.state.note.value
    assert bench.state.is_complete
    assert bench.library.names() == ("campaign",)


def test_only_one_calibration_runs_at_a_time(bench: CalibrateBench) -> None:
    _, control = bench.wizard("selftest")
    tries: list[Callable[[], None]] = [
        lambda: bench.control.run("geometry"),
        bench.control.run_everything,
        bench.control.keep,
    ]
    for again in tries:
        again()
        assert bench.told == "Self-test is still running. Finish or leave it first."
    bench.control.begin_campaign(bench.folder / "other")
    assert not (bench.folder / "other").exists()
    control.leave()
    bench.control.run("geometry")
    assert "needs selftest" in bench.told, "what it needs is named, and the wizard does not open"
    lock = FolderLock(bench.campaign / "lock")
    bench.control.run("selftest")
    assert "written by another process" in bench.told
    lock.release()
    bench.wizard("selftest")


def test_a_rig_in_use_is_not_taken(tmp_path: Path) -> None:
    class Busy(InlineRunner):
        jobs: tuple[Job[None], ...] = ()

        @property
        def active(self) -> tuple[Job[None], ...]:
            return self.jobs

    runner = Busy()
    bench = with_a_campaign(make_bench(tmp_path, runner))
    runner.jobs = (Job("Scan one", lambda progress: None, exclusive="the rig"),)
    bench.control.run("selftest")
    assert bench.told == "Scan one uses the rig. Wait for it, or cancel it."


def test_wrong_folders_and_other_rigs_are_named(bench: CalibrateBench, tmp_path: Path) -> None:
    bench.control.open_campaign(tmp_path)
    assert "is no campaign" in bench.told
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "thing").touch()
    bench.control.begin_campaign(tmp_path / "full")
    assert "neither empty nor a campaign" in bench.told
    bench.rig.connect(RigChoice("twin", (("scene", "plane"), ("size", "48x32"))))
    assert is_on(bench.state.foreign)
    assert "begun with the rig twin, scene plane, size 32x24" in bench.state.trouble.value
    bench.control.run("selftest")
    assert "another campaign" in bench.told
    bench.control.connect_rig()
    assert not is_on(bench.state.foreign)
    assert bench.state.trouble.value == ""
    bench.rig.disconnect()
    bench.control.run("selftest")
    assert "No rig is connected" in bench.told


def test_rows_say_why_a_calibration_is_not_good(bench: CalibrateBench) -> None:
    for name in ("selftest", "geometry"):
        calibrate(bench, name)
    bench.later = timedelta(days=91)
    bench.control.refresh()
    assert states(bench) == [RowState.AGEING, RowState.AGEING]
    bench.later = timedelta(0)
    bench.wrong = {"largest_dn": 1.0}
    _, control = bench.wizard("selftest")
    control.fit()
    control.accept()
    control.leave()
    assert states(bench) == [RowState.OUTSIDE, RowState.SUPERSEDED]
    assert bench.row("selftest").reason == "Open the aperture."
    assert bench.row("geometry").reason == "Self-test changed since. Fit again; its captures are kept."
    devices = bench.rig.state.devices.value
    assert devices is not None
    devices.camera._info = replace(devices.camera.info, binning=2)  # type: ignore[attr-defined]
    bench.control.refresh()
    assert states(bench) == [RowState.OTHER_RIG, RowState.OTHER_RIG]
    assert "The camera's binning was 1 and is 2." in bench.row("selftest").reason
    (bench.campaign / "selftest.json").write_text("{")
    bench.control.refresh()
    assert bench.row("selftest").state is RowState.DAMAGED


def test_the_key_figure_is_the_one_nearest_to_its_limits() -> None:
    def figure(name: str, value: float, low: float | None = None, high: float | None = None) -> Figure:
        return Figure(name=name, value=value, unit="px", low=low, high=high)

    easy, tight = figure("easy", 0.1, high=0.5), figure("tight", 0.45, high=0.5)
    beyond, between = figure("beyond", 0.2, low=0.3), figure("between", 2.0, low=1.0, high=3.0)
    assert key_figure((easy, tight, between)) is tight
    assert key_figure((tight, beyond)) is beyond
    assert key_figure((figure("free", 1.0),)) is None


def test_the_library_restores_exports_imports_and_is_used(bench: CalibrateBench, tmp_path: Path) -> None:
    library, state = bench.control.library, bench.state
    for name in ("selftest", "geometry"):
        calibrate(bench, name)
    first = bench.library.stamps("campaign")[0]
    rig = bench.library.find("campaign").rig
    bench.library.store("campaign", rig.model_copy(update={"white_scale": 1.0}))
    library.load()
    assert [line.is_current for line in state.library.value] == [True, False]
    library.restore("campaign", first)
    assert bench.library.find("campaign").stamp == first
    library.export(f"campaign@{first}", tmp_path / "out.json", "entry", False)
    library.export(f"campaign@{first}", tmp_path / "out.json", "entry", False)
    assert "exists already" in bench.told
    other = CalibrationLibrary(tmp_path / "elsewhere")
    assert other.names() == ()
    assert bench.control.open(tmp_path / "out.json")
    assert len(bench.library.stamps("campaign")) == 3
    (tmp_path / "other.json").write_text(json.dumps({"a": 1}))
    assert not bench.control.open(tmp_path / "other.json")
    opened: list[Path] = []
    state.opened.connect(opened.append)
    library.report("campaign")
    assert "<html" in opened[0].read_text()
    library.use("campaign")
    assert state.in_use.value == "campaign"


def test_the_command_line_names_campaign_and_rig(bench: CalibrateBench) -> None:
    where = f"{bench.campaign} --rig twin --option scene=plane --option size=32x24"
    assert bench.control.command_line("geometry") == f"dsl-scan calibrate geometry {where}"
    assert bench.control.command_line("selftest") == f"dsl-scan selftest {where}"
    assert bench.control.command_line() == f"dsl-scan calibrate all {where}"
    assert library_name(Path("a/(1) b")) == "1- b"


def test_leaving_while_something_runs_waits_for_its_end(bench: CalibrateBench) -> None:
    state, control = bench.wizard("selftest")
    control.go_to(1)
    left: list[Doing] = []

    def leave(doing: Doing) -> None:
        if doing is Doing.CAPTURING:
            left.append(doing)
            control.leave()

    state.doing.changed.connect(leave)
    control.capture()
    assert left == [Doing.CAPTURING]
    assert not (bench.campaign / "selftest" / "dim").exists(), "it was captured although the person had left"
    bench.wizard("selftest")


def test_another_devices_captures_do_not_pass(bench: CalibrateBench) -> None:
    calibrate(bench, "selftest")
    accepted = CampaignFolder.open(bench.campaign).accepted("selftest")
    assert isinstance(accepted, AcceptedCalibration)
    devices = bench.rig.state.devices.value
    assert isinstance(devices, DeviceRig)
    devices.camera._info = replace(devices.camera.info, serial="OTHER")  # type: ignore[attr-defined]
    state, control = bench.wizard("selftest")
    assert [each.state for each in state.statuses.value] == ["refused", "refused"]
    assert "serial number was TWIN-C and is OTHER" in state.statuses.value[0].reason
    control.leave()


def test_a_drift_check_needs_the_rig_that_was_calibrated(bench: CalibrateBench) -> None:
    devices, calibration = bench.calibrated
    assert bench.control.library.must_be_placed
    conditions = current_conditions(devices)
    other = conditions.model_copy(
        update={"projector": conditions.projector.model_copy(update={"mode": "6500 K"})}
    )
    bench.library.store("other", calibration.model_copy(update={"conditions": other}))
    bench.control.library.check("other")
    assert "the projector's mode was 6500 K and is not named" in bench.told
    assert bench.state.drift.value is None
    assert set(bench.notifier.offers) == {"Check anyway"}
    bench.rig.disconnect()
    bench.control.library.check("other")
    assert "No rig is connected" in bench.told


@pytest.fixture
def plane(tmp_path: Path) -> CalibrateBench:
    """A connected twin of a flat target that can be checked for drift."""
    choice = RigChoice("twin", (("scene", "plane"), ("size", "112x72")))
    made = make_bench(tmp_path, choice=choice)
    made.rig.connect(choice)
    return made


def test_a_drift_check_of_the_twin_says_that_nothing_has_moved(plane: CalibrateBench) -> None:
    _, calibration = plane.calibrated
    plane.library.store("own", calibration)
    plane.control.library.check("own")
    verdict = plane.state.drift.value
    assert verdict is not None, plane.told
    assert {figure.name for figure in verdict.figures} >= {"row drift"}
    assert "The rig matches the calibration own." in plane.state.note.value


def test_a_check_in_spite_of_other_settings_says_which(plane: CalibrateBench) -> None:
    devices, calibration = plane.calibrated
    conditions = current_conditions(devices)
    gain = conditions.camera.model_copy(update={"gain_db": 6.0})
    other = calibration.model_copy(update={"conditions": conditions.model_copy(update={"camera": gain})})
    plane.library.store("own", other)
    plane.control.library.check("own")
    assert "the camera's gain (dB) was 6 and is 0" in plane.told
    plane.notifier.offers["Check anyway"]()
    verdict = plane.state.drift.value
    assert verdict is not None, plane.told
    assert verdict.overridden == ("the camera's gain (dB) was 6 and is 0",)
