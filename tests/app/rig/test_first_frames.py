"""The first picture of a live view is of what is connected and stands there now."""

from __future__ import annotations

import numpy as np
import pytest
from dsl_app.connection.controller import RigController
from dsl_app.connection.state import RigChoice, RigState
from dsl_app.rig.controller import LiveController
from dsl_app.rig.state import FrameCounts

from dsl_core.errors import Cancelled
from dsl_core.model.frames import Frame
from dsl_core.model.placement import Placement
from dsl_core.progress import NoProgress
from tests.app.support.doubles import InlineRunner, RecordingNotifier

TWIN = RigChoice("twin", (("scene", "plane"), ("size", "64x48")))


@pytest.fixture
def live() -> LiveController:
    """The live view of a twin that is connected."""
    notifier = RecordingNotifier()
    made = LiveController(RigController(RigState(TWIN), InlineRunner(), notifier), notifier)
    made.rig.connect(TWIN)
    return made


def frame(number: int) -> Frame:
    return Frame(np.zeros((4, 4), np.uint16), 10.0, frame_id=number)


def shown_after_a_fetch(live: LiveController) -> int | None:
    live.fetch_frame()
    shown = live.state.frame.value
    return None if shown is None else shown.frame_id


def test_the_last_frame_of_a_live_view_is_not_the_first_of_the_next(live: LiveController) -> None:
    live.rig.state.live.set(True)
    live._post(frame(1), 10.0)
    live.rig.state.live.set(False)
    live.rig.state.live.set(True)
    assert shown_after_a_fetch(live) is None, "it is of the time before, and would be exposed for"
    live._post(frame(2), 10.0)
    assert shown_after_a_fetch(live) == 2


def test_what_one_camera_saw_is_not_shown_as_seen_by_the_next(live: LiveController) -> None:
    live._post(frame(1), 10.0)
    live.fetch_frame()
    live._post(frame(2), 10.0)
    live.rig.connect(RigChoice("twin", (("scene", "plane"), ("size", "32x24"))))
    assert live.state.frame.value is None
    live.fetch_frame()
    assert live.state.frame.value is None


def test_a_live_view_shows_the_scene_and_not_the_target_of_a_calibration(
    live: LiveController, monkeypatch: pytest.MonkeyPatch
) -> None:
    devices = live.rig.state.devices.value
    assert devices is not None
    assert devices.place is not None
    assert devices.standing is not None
    devices.place(Placement(target="spectralon", film=False))
    assert devices.standing() == "spectralon, film off"
    stood: list[str] = []

    def post(taken: Frame, requested_ms: float) -> None:
        assert devices is not None
        assert devices.standing is not None
        stood.append(devices.standing())
        raise Cancelled

    monkeypatch.setattr(live, "_post", post)
    with pytest.raises(Cancelled):
        live._look(devices, NoProgress())
    assert stood == ["plane"]
    assert live._counts == FrameCounts()
