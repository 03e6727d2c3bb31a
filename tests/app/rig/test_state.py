from __future__ import annotations

from dsl_app.connection.controller import RigController
from dsl_app.connection.state import Link, RigChoice, RigState
from dsl_app.rig.state import LiveState, cycles_text, panel_view, rig_view

from dsl_core.devices.base import ProjectorInfo
from tests.app.support.doubles import InlineRunner, RecordingNotifier

TWIN = RigChoice("twin", (("scene", "plane"), ("size", "64x48")))


def test_a_page_without_a_rig_offers_to_connect_one() -> None:
    rig, live = RigState(TWIN), LiveState()
    view = rig_view(rig, live)
    assert (view.link, view.link_role, view.connect, view.can_connect) == (
        "● not connected", "muted", "Connect", True,
    )  # fmt: skip
    assert (view.camera, view.projector, view.cycles) == ("–", "–", "")
    assert not view.has_devices
    assert not view.can_expose
    rig.link.set(Link.OPENING)
    assert not rig_view(rig, live).can_connect


def test_a_page_with_a_rig_names_its_devices_and_offers_to_expose() -> None:
    live = LiveState()
    controller = RigController(RigState(TWIN), InlineRunner(), RecordingNotifier())
    controller.connect(TWIN)
    rig = controller.state
    view = rig_view(rig, live)
    assert (view.connect, view.link_role, view.live) == ("Disconnect", "good", "Start live view")
    assert view.camera.endswith("64 × 48 px")
    assert view.has_devices
    assert view.can_expose
    assert "LED cycle" in view.cycles
    rig.live.set(True)
    live.is_exposing.set(True)
    view = rig_view(rig, live)
    assert view.live == "Stop live view"
    assert not view.can_expose


def test_a_lost_rig_can_be_connected_again_and_says_why_it_is_lost() -> None:
    rig, live = RigState(TWIN), LiveState()
    rig.link.set(Link.LOST)
    rig.trouble.set("The camera sent no frame.")
    view = rig_view(rig, live)
    assert (view.trouble, view.link_role, view.connect) == ("The camera sent no frame.", "bad", "Connect")


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
