from __future__ import annotations

from dataclasses import replace

from dsl_app.connection.controller import RigController
from dsl_app.connection.state import Link, RigChoice, RigState
from dsl_app.rig.state import (
    LOST,
    LOST_PICTURE,
    NO_PICTURE,
    NO_RIG,
    STOPPED,
    WAITING,
    LiveState,
    cycles_text,
    panel_view,
    picture_note,
    rate_text,
    rig_view,
)

from dsl_core.devices.base import ProjectorInfo
from tests.app.support.doubles import InlineRunner, RecordingNotifier

TWIN = RigChoice("twin", (("scene", "plane"), ("size", "64x48")))


def test_a_page_without_a_rig_offers_to_connect_one() -> None:
    rig, live = RigState(TWIN), LiveState()
    view = rig_view(rig, live)
    assert (view.link.text, view.link.role) == ("● not connected", "muted")
    assert (view.connect_button.text, view.connect_button.is_enabled) == ("Connect", True)
    assert (view.connect_button.is_primary, view.live_button.is_primary) == (True, False)
    assert (view.camera_text, view.projector_text, view.cycles.text) == ("–", "–", "")
    buttons = (view.live_button, view.selftest, view.scan)
    assert [*(button.is_enabled for button in buttons), view.exposure, view.auto] == 5 * [False]
    rig.link.set(Link.OPENING)
    button = rig_view(rig, live).connect_button
    assert (button.is_enabled, button.text) == (False, "Connecting…")


def test_a_page_with_a_rig_names_its_devices_and_offers_to_expose() -> None:
    live = LiveState()
    controller = RigController(RigState(TWIN), InlineRunner(), RecordingNotifier())
    controller.connect(TWIN)
    rig = controller.state
    view = rig_view(rig, live)
    assert (view.connect_button.text, view.link.role) == ("Disconnect", "good")
    assert (view.live_button.text, view.live_button.is_enabled) == ("Start live view", True)
    assert (view.connect_button.is_primary, view.live_button.is_primary) == (False, True)
    assert view.camera_text.endswith("64 × 48 px")
    assert view.selftest.is_enabled
    assert not view.selftest.is_primary
    assert view.exposure
    assert view.auto
    assert "LED cycle" in view.cycles.text
    assert view.cycles.role == "muted"
    live.exposure_ms.set(60.0)
    assert rig_view(rig, live).cycles.role == "warn", "colours that vary are no remark"
    rig.live.set(True)
    live.is_exposing.set(True)
    view = rig_view(rig, live)
    assert view.live_button.text == "Stop live view"
    assert not view.live_button.is_primary
    assert not view.auto
    # The twin is calibrated; any other rig is tested first.
    assert (view.selftest.is_primary, view.scan.is_primary) == (False, True)
    assert rig.devices.value is not None
    rig.devices.set(replace(rig.devices.value, calibration=None))
    view = rig_view(rig, live)
    assert (view.selftest.is_primary, view.scan.is_primary) == (True, False)


def test_a_form_that_shows_another_rig_is_connected_next() -> None:
    controller = RigController(RigState(TWIN), InlineRunner(), RecordingNotifier())
    controller.connect(TWIN)
    rig, live = controller.state, LiveState()
    for is_live in (False, True):
        rig.live.set(is_live)
        view = rig_view(rig, live, is_other=True)
        assert view.connect_button.text == "Connect"
        buttons = (view.connect_button, view.live_button, view.selftest, view.scan)
        assert [each.is_primary for each in buttons] == [True, False, False, False]


def test_a_lost_rig_can_be_connected_again_and_says_why_it_is_lost() -> None:
    controller = RigController(RigState(TWIN), InlineRunner(), RecordingNotifier())
    controller.connect(TWIN)
    rig, live = controller.state, LiveState()
    rig.link.set(Link.LOST)
    rig.trouble.set("The camera sent no frame.")
    view = rig_view(rig, live)
    assert (view.trouble.text, view.link.role) == ("The camera sent no frame.", "bad")
    # What was wrong with one rig is not said of another that is chosen next.
    assert rig_view(rig, LiveState(), is_of_other_rig=True).trouble.text == ""
    assert view.connect_button.text == "Connect"
    buttons = (view.live_button, view.selftest, view.scan)
    assert [*(each.is_enabled or each.is_primary for each in buttons), view.auto] == 4 * [False]
    assert view.connect_button.is_primary


def test_the_picture_says_what_else_would_be_taken_for_the_present() -> None:
    controller = RigController(RigState(TWIN), InlineRunner(), RecordingNotifier())
    rig = controller.state
    assert picture_note(rig, False).text == NO_RIG
    rig.link.set(Link.OPENING)
    assert picture_note(rig, False).text == "Connecting twin, scene plane, size 64x48…"
    rig.link.set(Link.CLOSED)
    controller.connect(TWIN)
    assert [picture_note(rig, has).text for has in (False, True)] == [NO_PICTURE, STOPPED]
    rig.live.set(True)
    assert [picture_note(rig, has).text for has in (False, True)] == [WAITING, ""]
    rig.link.set(Link.LOST)
    notes = [picture_note(rig, has) for has in (False, True)]
    assert [(note.text, note.role) for note in notes] == [(LOST, "bad"), (LOST_PICTURE, "bad")]


def test_a_rate_is_told_only_while_frames_come() -> None:
    fast, slow = [0.0, 0.05, 0.1], [0.0, 5.0, 10.0]
    assert [rate_text(fast, now, True) for now in (0.12, 3.1)] == ["20 frames/s", "no frame for 3 s"]
    assert [rate_text(slow, now, True) for now in (14.0, 31.0)] == [
        "a frame every 5.0 s",
        "no frame for 21 s",
    ]
    assert [rate_text(fast, 0.12, False), rate_text([], 9.0, True), rate_text([1.0], 1.5, True)] == [""] * 3


def test_parts_of_a_cycle_are_named() -> None:
    assert cycles_text(1000 / 6, 1000 / 60) == "10 LED cycles"
    assert cycles_text(160.0, 1000 / 60) == "9.60 LED cycles: colours vary"
    assert cycles_text(160.0, None) == ""


def test_the_projector_is_free_unless_a_job_uses_it() -> None:
    info = ProjectorInfo("PT-1", "0", 640, 360, 50.0, 16.7)
    free, used, none = panel_view(info, ""), panel_view(info, "Scan first"), panel_view(None, "")
    assert (free.can_show, free.can_choose_screen) == (True, True)
    assert free.note == "PT-1, 640 × 360 logical pixels"
    assert (used.can_show, used.can_choose_screen) == (False, False)
    assert used.note == "Scan first is using the projector. Pictures can be shown when it has ended."
    assert (none.can_show, none.can_choose_screen) == (False, True)
