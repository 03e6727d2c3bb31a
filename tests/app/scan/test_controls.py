"""What the Scan page's controls say and allow, for every phase."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from dsl_app.scan.controls import RECONNECT, RESUME, banner_controls, frame_text, progress_text, run_controls
from dsl_app.scan.state import Facts, InterruptedScan, LivePicture, Phase, Reconnection
from dsl_app.shared.notify import NO_RIG

from dsl_core.capture.runner import State, Status
from dsl_core.model.presets import PRESETS

FREE = Facts(76, 12.0, 1000, 10**9)
BLOCKED = Facts(76, 12.0, 1000, 10**9, obstacles=("No rig is connected.", "The disk is full."))
HALF = InterruptedScan(Path("half.dsl"), 30, 76)


@pytest.mark.parametrize(
    ("phase", "can_start", "can_pause", "can_cancel", "role"),
    [
        (Phase.PLANNING, True, False, False, "muted"),
        (Phase.STARTING, False, False, True, "muted"),
        (Phase.RUNNING, False, True, True, "muted"),
        (Phase.PAUSED, False, True, True, "warn"),
        (Phase.STOPPING, False, False, False, "muted"),
        (Phase.DONE, True, False, False, "good"),
        (Phase.STOPPED, True, False, False, "warn"),
        (Phase.LOST, True, False, False, "bad"),
    ],
)
def test_buttons_follow_the_phase(
    phase: Phase, can_start: bool, can_pause: bool, can_cancel: bool, role: str
) -> None:
    shown = run_controls(phase, None, FREE, "", has_finished=True)
    assert (shown.start.is_enabled, shown.pause.is_enabled, shown.cancel) == (
        can_start,
        can_pause,
        can_cancel,
    )
    assert (shown.phase.text, shown.phase.role) == (f"● {phase.value}", role)
    assert shown.pause.text == ("Cont&inue" if phase is Phase.PAUSED else "&Pause")
    # What is paused is continued next.
    assert shown.pause.is_primary == (phase is Phase.PAUSED)
    assert not (shown.start.is_primary and shown.pause.is_primary)
    assert shown.again.is_visible is not phase.is_busy


def test_while_a_scan_is_reconstructed_there_is_only_to_wait() -> None:
    for is_reconstructing in (True, False):
        shown = run_controls(
            Phase.DONE, None, FREE, "", has_finished=True, is_reconstructing=is_reconstructing
        )
        assert shown.start.is_enabled
        assert shown.start.is_primary is not is_reconstructing


def test_obstacles_keep_a_plan_from_starting_but_not_from_being_shown() -> None:
    shown = run_controls(Phase.PLANNING, None, BLOCKED, "", has_finished=False)
    assert (shown.start.is_enabled, shown.phase.text, shown.remarks.role) == (False, "● not ready", "warn")
    assert shown.remarks.text == "No rig is connected.\nThe disk is full."
    running = run_controls(Phase.RUNNING, None, BLOCKED, "", has_finished=False)
    assert (running.remarks.text, running.remarks.role) == ("", "muted")


def test_an_interrupted_scan_is_resumed_or_left() -> None:
    shown = run_controls(Phase.LOST, HALF, FREE, "A note.", has_finished=False)
    assert (shown.resume.text, shown.renew.is_visible, shown.again.is_visible) == (
        "Resume sca&n",
        True,
        False,
    )
    assert (shown.start.is_visible, shown.resume.is_visible) == (False, True)
    # What was finished before is not what the buttons below speak of.
    assert not run_controls(Phase.STOPPED, HALF, FREE, "", has_finished=True).again.is_visible
    fresh = run_controls(Phase.PLANNING, None, FREE, "", has_finished=False)
    assert (fresh.start.is_visible, fresh.resume.is_visible, fresh.start.text) == (True, False, None)
    assert shown.drift == shown.renew
    assert shown.remarks.text == "half: 30 of 76 frames are safe.\nA note."
    assert not run_controls(Phase.RUNNING, HALF, FREE, "", has_finished=False).renew.is_visible
    away = replace(FREE, connects=True)
    assert run_controls(Phase.PLANNING, HALF, away, "", False).resume.text == "Co&nnect and resume"


@pytest.mark.parametrize(
    ("reconnection", "action", "tip", "is_enabled", "can_stop"),
    [
        (Reconnection.NONE, "Resume", RESUME, True, False),
        (Reconnection.TRYING, "Connect and resume", RECONNECT, True, True),
        (Reconnection.RESUMING, "Connect and resume", RECONNECT, False, True),
        (Reconnection.GIVEN_UP, "Connect and resume", RECONNECT, True, False),
        (Reconnection.BACK, "Resume", RESUME, True, False),
    ],
)
def test_the_banner_follows_the_reconnection(
    reconnection: Reconnection, action: str, tip: str, is_enabled: bool, can_stop: bool
) -> None:
    shown = banner_controls(reconnection)
    assert (shown.action.text, shown.action.tip, shown.action.is_enabled) == (action, tip, is_enabled)
    assert shown.stop.is_visible is can_stop


def test_the_banner_of_a_scan_that_saved_nothing_starts_it_again() -> None:
    assert banner_controls(Reconnection.NONE, has_frames=False).action.text == "Start again"
    assert banner_controls(Reconnection.TRYING, has_frames=False).action.text == "Connect and start again"


def test_the_last_frame_tells_its_exposure_its_pace_and_what_came_twice() -> None:
    shot = next(iter(PRESETS[0].plan.shots()))
    shown = LivePicture(
        PRESETS[0].plan, shot, np.zeros((2, 2, 3), np.uint8), 2, brightest=0.62, saturated=0.014
    )
    half = Status(State.RUNNING, done=38, total=78, elapsed_s=20.0, remaining_s=20.0, corrected=2)
    said = frame_text(half, shown)
    assert [each.text for each in (said.brightest, said.saturated, said.each, said.again)] == [
        "62 % of full scale",
        "1.4 % of the pixels",
        "0.5 s",
        "2: a picture did not show its pattern",
    ]
    assert said.again.role == "warn"
    before = frame_text(Status(State.IDLE), None)
    assert (before.brightest.text, before.each.text, before.again.text) == ("–", "–", "none")


def test_progress_is_empty_until_there_is_some() -> None:
    assert progress_text(Status(State.IDLE)).frames.text == ""
    half = Status(State.RUNNING, done=38, total=76, elapsed_s=20.0, remaining_s=20.0)
    assert (progress_text(half).frames.text, progress_text(half).time.text) == (
        "38 of 76 frames saved",
        "20 s so far, 20 s left",
    )
    over = Status(State.FINISHED, done=76, total=76, elapsed_s=41.0)
    assert progress_text(over).time.text == "took 41 s"


def test_the_time_of_a_resumed_scan_is_that_of_the_frames_since() -> None:
    half = Status(State.RUNNING, done=61, total=76, elapsed_s=2.0, remaining_s=20.0, earlier=60)
    assert progress_text(half).time.text == "1 frame took 2 s, 20 s left"
    over = Status(State.FINISHED, done=76, total=76, elapsed_s=14.0, earlier=60)
    assert progress_text(over).time.text == "16 frames took 14 s"


def test_frames_that_nothing_was_made_of_are_reconstructed_next() -> None:
    raw = run_controls(Phase.DONE, None, FREE, "", has_finished=True, has_result=False)
    assert (raw.start.is_primary, raw.again.is_primary, raw.again.text) == (False, True, "Reconstruct…")
    # It cannot be before there is a calibration; the button stays, for one in a file.
    bare = run_controls(
        Phase.DONE, None, FREE, "", has_finished=True, has_result=False, must_calibrate=True
    ).again
    assert (bare.is_primary, bare.is_visible, bare.is_enabled) == (False, True, True)
    done = run_controls(Phase.DONE, None, FREE, "", has_finished=True, has_result=True)
    assert (done.start.is_primary, done.again.is_primary) == (True, False)
    made = run_controls(
        Phase.DONE, None, FREE, "", has_finished=True, has_result=False, is_reconstructing=True
    )
    assert (made.start.is_primary, made.again.is_primary) == (False, False)


def test_without_a_rig_the_next_thing_is_to_connect_it() -> None:
    shown = run_controls(Phase.PLANNING, None, replace(FREE, obstacles=(NO_RIG,)), "", has_finished=False)
    assert (shown.connect_rig.is_visible, shown.connect_rig.is_primary) == (True, True)
    assert (shown.start.is_enabled, shown.start.is_primary) == (False, False)
    assert not run_controls(Phase.PLANNING, None, FREE, "", has_finished=False).connect_rig.is_visible
