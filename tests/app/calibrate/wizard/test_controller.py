"""One calibration step by step: captures, looks, fits and settings, without a window."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from dsl_app.calibrate.state import RowState
from dsl_app.calibrate.wizard.controller import WizardController
from dsl_app.calibrate.wizard.ghost import PointsPx, as_points, ghost
from dsl_app.calibrate.wizard.presentation import NONE_KEPT, step_display
from dsl_app.calibrate.wizard.state import Doing, WizardState
from dsl_app.connection.state import Link

from dsl_core import pipeline
from dsl_core.capture.proven.wrong_pictures import PictureError
from dsl_core.devices.base import DeviceRig
from dsl_core.errors import CalibrationError, DeviceError, StoreError
from dsl_core.io.campaign_folder import CampaignFolder
from dsl_core.io.rig_file import load_rig
from dsl_core.model.calibration.accepted import AcceptedCalibration
from dsl_core.model.frames import Frame
from dsl_core.model.placement import Placement
from dsl_core.simulation.sim_devices import SimCamera
from tests.app.calibrate.calibrate_bench import (
    CalibrateBench,
    calibrate,
    fit_of,
    is_on,
    page,
    states,
)


def test_a_wizard_goes_from_placement_to_acceptance_and_writes_the_rig(bench: CalibrateBench) -> None:
    assert states(bench) == [RowState.MISSING, RowState.MISSING]
    state, control = bench.wizard("selftest")
    assert page(state) == 1
    assert state.title == "Self-test"
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
    assert all(row.state.is_accepted for row in bench.state.rows.value)
    assert bench.library.names() == ("campaign",)
    assert [line.name for line in bench.state.library.value] == ["campaign"]


def mean_seen(state: WizardState) -> float:
    assert state.seen.value is not None
    return float(state.seen.value.picture.mean())


#: A board where `FRONT` wants it in the twin's picture of 32 x 24 pixels, near it, and elsewhere.
FRONT = Placement(target="board", options={"columns": 3, "rows": 3, "square_mm": 60.0, "depth_mm": 700.0})
ASIDE = ((2.0, 2.0), (8.0, 2.0), (8.0, 8.0), (2.0, 8.0))


def in_the_outline(bench: CalibrateBench, moved_px: float = 0.0) -> PointsPx:
    wanted = ghost(FRONT, bench.calibrated[1].camera)
    return as_points(np.array(wanted) + moved_px)


def look_again(control: WizardController) -> None:
    control._looked_at -= 10.0
    control.take_news()


def test_a_board_that_is_right_and_still_is_captured_by_itself(bench: CalibrateBench) -> None:
    there = in_the_outline(bench)
    bench.wrong = {"placement": FRONT, "points_px": (ASIDE, ASIDE, there, there)}
    state, control = bench.wizard("selftest")
    control.check(True)
    look_again(control)
    assert page(state) == 1, "a board elsewhere was captured"
    look_again(control)
    assert page(state) == 1, "a board was captured on its way"
    look_again(control)
    assert page(state) == 2
    assert state.note.value == "dim picture is captured. 1 to go."
    assert state.covered.value == there
    assert is_on(state.is_checking), "the person has no hand free for the next check"
    assert state.look.value is None


def test_a_board_is_seen_at_once_and_captured_once_it_was_moved(bench: CalibrateBench) -> None:
    there = in_the_outline(bench)
    bench.wrong = {"placement": FRONT, "points_px": (there, there, there, ASIDE, there, there)}
    state, control = bench.wizard("selftest")
    control.take_news()
    assert state.look.value is not None, "the outline is not seen before the first click"
    assert state.look.value.is_in_place
    for _ in range(2):
        look_again(control)
    assert page(state) == 1, "a board that was left there, perhaps behind the film, was captured"
    look_again(control)
    look_again(control)
    assert page(state) == 1
    look_again(control)
    assert page(state) == 2, "a board that a person brought there was not captured"


def test_a_board_that_moves_is_not_captured_by_itself(bench: CalibrateBench) -> None:
    where = tuple(in_the_outline(bench, 0.4 * (place % 2 * 2 - 1)) for place in range(4))
    bench.wrong = {"placement": FRONT, "points_px": where}
    state, control = bench.wizard("selftest")
    control.check(True)
    for _ in range(3):
        look_again(control)
    look = state.look.value
    assert look is not None
    assert look.is_in_place
    assert page(state) == 1


def test_nothing_is_captured_by_itself_unless_a_person_wants_it(bench: CalibrateBench) -> None:
    bench.wrong = {"placement": FRONT, "points_px": (in_the_outline(bench),)}
    state, control = bench.wizard("selftest")
    control.capture_itself(False)
    control.check(True)
    look_again(control)
    look_again(control)
    assert page(state) == 1
    control.check(False)
    control.capture()
    assert page(state) == 2
    assert not is_on(state.is_checking), "a capture by hand starts no checks"
    control.capture_itself(True)
    control.go_to(1)
    control.check(True)
    look_again(control)
    look_again(control)
    assert page(state) == 1, "a captured step was captured again"


def test_a_wizard_goes_on_where_it_was_left(bench: CalibrateBench) -> None:
    state, control = bench.wizard("selftest")
    control.go_to(1)
    control.capture()
    control.leave()
    assert bench.row("selftest").state is RowState.BEGUN
    assert bench.row("selftest").reason == "1 of 2 captured"
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


def test_discarding_a_later_fit_shows_the_accepted_one_again(bench: CalibrateBench) -> None:
    calibrate(bench, "selftest")
    state, control = bench.wizard("selftest")
    accepted = fit_of(state)
    assert accepted is not None
    control.fit()
    later = fit_of(state)
    assert later is not None
    assert not later.is_accepted
    control.discard()
    shown = fit_of(state)
    assert shown is not None
    assert shown.is_accepted
    assert shown.fitted == accepted.fitted


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
        assert bench.rig.state.link.value is Link.LOST, "other pages would still call it connected"
        assert bench.rig.state.trouble.value == state.trouble.value
        # Its window lies over the messages of the main one.
        control.reconnect()
        assert state.trouble.value.startswith(
            "The rig could not be connected again: The camera sent no frame"
        )
        assert is_on(state.can_reconnect)
        assert bench.rig.state.link.value is Link.LOST
    before = bench.rig.state.devices.value
    control.reconnect()
    assert bench.rig.state.devices.value is not before
    assert not is_on(state.can_reconnect)
    assert page(state) == 1
    control.capture()
    assert not state.trouble.value
    assert state.statuses.value[0].state == "captured"


def test_a_camera_whose_pictures_are_wrong_is_not_lost(
    bench: CalibrateBench, monkeypatch: pytest.MonkeyPatch
) -> None:
    state, control = bench.wizard("selftest")
    control.go_to(1)

    def wrong(*_: object, **__: object) -> None:
        raise PictureError("White does not show its pattern. Switch automatic exposure off.")

    monkeypatch.setattr(pipeline, "scan", wrong)
    control.capture()
    assert "automatic exposure" in state.trouble.value
    assert not is_on(state.can_reconnect)
    assert bench.rig.state.link.value is Link.OPEN


def test_a_full_disk_costs_nothing_captured(bench: CalibrateBench, monkeypatch: pytest.MonkeyPatch) -> None:
    state, control = bench.wizard("selftest")
    control.go_to(1)
    control.capture()
    with monkeypatch.context() as full:

        def no_room(*_: object) -> None:
            raise StoreError("The disk is full: free some space and try again.")

        full.setattr("dsl_core.campaign.session.replace_record", no_room)
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
    # By the name that stands before its field.
    assert state.settings_trouble.value.startswith("Scale must be a number (given ")
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
    assert not state.is_checking.value
    assert not placed, "a rig moves nothing before a person asks for it"
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


def test_a_captured_step_that_is_visited_again_shows_its_own_picture(bench: CalibrateBench) -> None:
    state, control = bench.wizard("selftest")
    for _ in range(2):
        control.capture()
    control.take_news()
    shown = []
    for step in (1, 2):
        control.go_to(step)
        shown.append(mean_seen(state))
    assert shown[1] > 1.2 * shown[0]
    control.leave()
    state, control = bench.wizard("selftest")
    control.go_to(1)
    assert mean_seen(state) == shown[0], "it is read from disk"
    # A step that is not captured yet shows nothing of another one.
    control.change_settings({"keys": "dim,night"})
    control.go_to(2)
    assert not is_on(state.is_checking)
    assert state.seen.value is None


def test_a_captured_step_without_frames_says_so(bench: CalibrateBench) -> None:
    state, control = bench.wizard("selftest")
    control.capture()
    (bench.campaign / "selftest" / "dim" / "scan.dsl" / "manifest.json").rename(bench.folder / "away")
    work = control._the_work
    assert work.kept_picture(work.session.steps[0]) is None
    control.go_to(1)
    shown = step_display(state)
    assert shown is not None
    assert shown.why_no_picture == NONE_KEPT


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
