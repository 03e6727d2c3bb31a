"""What a wizard shows for each state of its work, decided without a window."""

from __future__ import annotations

from dataclasses import fields
from typing import Any, cast

import pytest
from dsl_app.calibrate.wizard.presentation import (
    Buttons,
    activity,
    buttons,
    fit_display,
    leaving_text,
    main_button,
    page_before,
    page_lines,
    step_display,
    stopped_text,
)
from dsl_app.calibrate.wizard.state import Doing, Fit, Look, WizardState
from dsl_app.shared.jobs.base import JobProgress

from dsl_core.campaign.common.recipe import Step
from dsl_core.campaign.selftest.recipe import SelfTestRecipe
from dsl_core.campaign.session import CalibrationSession, State, StepStatus
from dsl_core.model.base import Record
from dsl_core.model.calibration.accepted import AcceptedCalibration
from dsl_core.model.figure import Figure
from dsl_core.model.placement import Placement

GOOD = Figure(name="error", value=0.2, unit="px", high=0.5, advice="Hold it still.")
BAD = GOOD.model_copy(update={"value": 0.8})
FREE = Figure(name="distance", value=700.0, unit="mm")
SETTINGS, FIRST, SECOND, LAST = range(4)


def status(key: str, state: State = "missing", reason: str = "") -> StepStatus:
    return StepStatus(Step(key, f"Step {key}", f"Place {key}.", Placement(target="board")), state, reason)


def fit(*figures: Figure, accepted: bool = False) -> Fit:
    fitted = AcceptedCalibration(name="test", title="Test", figures=figures)
    return Fit(fitted, Record(), cast(CalibrationSession, None), accepted)


def wizard(
    at: int = SETTINGS,
    states: tuple[State, State] = ("missing", "missing"),
    doing: Doing = Doing.IDLE,
    **values: Any,
) -> WizardState:
    """A wizard of two steps; ``values`` are those of the state by their names."""
    made = WizardState("test", "Test")
    made.statuses.set((status("a", states[0]), status("b", states[1], "it was moved")))
    made.doing.set(doing)
    made.at.set(at)
    for name, value in values.items():
        getattr(made, name).set(value)
    return made


def may_accept(state: WizardState) -> bool:
    return buttons(state).accept.is_enabled


def names(shown: Buttons, what: str) -> set[str]:
    """Names of the visible buttons for which ``what`` is true."""
    every = {each.name: getattr(shown, each.name) for each in fields(Buttons)}
    return {name for name, button in every.items() if button.is_visible and getattr(button, what)}


OUTLINES = {"a": ((0.0, 0.0), (10.0, 0.0), (10.0, 10.0), (0.0, 10.0))}
#: A target that is captured by itself once it is in its outline.
AWAITED: dict[str, Any] = {"outlines": OUTLINES, "is_checking": True, "is_awaited": True}
CAPTURED: tuple[State, State] = ("captured", "captured")
HALF: tuple[State, State] = ("captured", "missing")

#: A state, its visible buttons, those of them that are enabled, and the main one.
CASES: dict[str, tuple[WizardState, str, str, str]] = {
    "settings": (wizard(), "leave back", "leave back", "back"),
    "a step to capture": (
        wizard(FIRST), "leave back check capture next", "leave check capture next", "capture"
    ),
    "a step that the rig places itself": (
        wizard(FIRST, places_itself=True),
        "leave back check all capture next",
        "leave check all capture next",
        "all",
    ),
    "a target that a person brings into its outline": (
        wizard(FIRST, outlines=OUTLINES),
        "leave back itself check capture next",
        "leave itself check capture next",
        "check",
    ),
    "a target that is looked at": (
        wizard(FIRST, outlines=OUTLINES, is_checking=True),
        "leave back itself check capture next",
        "leave itself check capture next",
        "capture",
    ),
    "a captured step": (
        wizard(FIRST, HALF), "leave back check capture next", "leave check capture next", "next"
    ),
    "all is captured, so there is nothing left to capture at once": (
        wizard(FIRST, CAPTURED, places_itself=True),
        "leave back check capture next",
        "leave check capture next",
        "next",
    ),
    "a refused step": (
        wizard(SECOND, ("captured", "refused")),
        "leave back check capture next",
        "leave back check capture next",
        "capture",
    ),
    "a look does not lock the buttons": (
        wizard(FIRST, doing=Doing.LOOKING),
        "leave back check capture next",
        "leave check capture next",
        "capture",
    ),
    "reading settings does": (
        wizard(FIRST, doing=Doing.OPENING), "leave back check capture next", "leave", "capture"
    ),
    "a capture can only be stopped": (
        wizard(FIRST, doing=Doing.CAPTURING), "leave back stop next", "leave stop", "capture"
    ),
    "stopping is not stopped again": (
        wizard(FIRST, doing=Doing.STOPPING), "leave back stop next", "leave", "capture"
    ),
    "a fit that lacks captures": (
        wizard(LAST, HALF), "leave back fit accept", "leave back", "back"
    ),
    "a fit that lacks captures of a rig that places targets itself": (
        wizard(LAST, HALF, places_itself=True), "leave back all fit accept", "leave back all", "all"
    ),
    "everything captured": (
        wizard(LAST, CAPTURED), "leave back fit accept", "leave back fit", "fit"
    ),
    "fitting": (
        wizard(LAST, CAPTURED, Doing.FITTING), "leave back stop", "leave stop", "fit"
    ),
    "a good fit": (
        wizard(LAST, CAPTURED, fit=fit(GOOD)),
        "leave back discard fit accept",
        "leave back discard fit accept",
        "accept",
    ),
    "a fit outside its limits": (
        wizard(LAST, CAPTURED, fit=fit(GOOD, BAD)),
        "leave back discard fit accept",
        "leave back discard fit",
        "accept",
    ),
    "a fit outside its limits that the person allows": (
        wizard(LAST, CAPTURED, fit=fit(BAD), allowed=(BAD,)),
        "leave back discard fit accept",
        "leave back discard fit accept",
        "accept",
    ),
    "writing": (
        wizard(LAST, CAPTURED, Doing.KEEPING, fit=fit(GOOD)),
        "leave back discard fit accept",
        "leave",
        "accept",
    ),
    "an accepted fit": (
        wizard(LAST, CAPTURED, fit=fit(GOOD, accepted=True)),
        "leave back fit accept",
        "leave back fit",
        "leave",
    ),
    "a step of an accepted calibration": (
        wizard(FIRST, CAPTURED, fit=fit(GOOD, accepted=True)),
        "leave back check capture next",
        "leave check capture next",
        "next",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", CASES)
def test_every_state_has_its_buttons(case: str) -> None:
    state, visible, enabled, main = CASES[case]
    shown = buttons(state)
    assert names(shown, "is_visible") == set(visible.split())
    assert names(shown, "is_enabled") == set(enabled.split())
    every = [each.name for each in fields(Buttons) if getattr(shown, each.name).is_primary]
    assert every == [main] == [main_button(state)]


@pytest.mark.parametrize(
    ("state", "text"),
    [
        (wizard(FIRST), "&Capture"),
        (wizard(FIRST, look=Look("a", (GOOD,))), "&Capture"),
        (wizard(FIRST, look=Look("a", (BAD,))), "&Capture anyway"),
        (wizard(FIRST, look=Look("a", (), "No board was found.")), "&Capture anyway"),
        (wizard(FIRST, HALF, look=Look("a", (BAD,))), "&Redo this step"),
    ],
)
def test_the_capture_button_says_what_it_does(state: WizardState, text: str) -> None:
    assert buttons(state).capture.text == text
    assert buttons(state).capture.tip


def test_the_fit_button_and_the_leave_button_follow_the_fit() -> None:
    none, waits = wizard(LAST, CAPTURED), wizard(LAST, CAPTURED, fit=fit(GOOD))
    done = wizard(LAST, CAPTURED, fit=fit(GOOD, accepted=True))
    assert [buttons(each).fit.text for each in (none, waits, done)] == ["&Fit", "&Fit again", "&Fit again"]
    assert [buttons(each).leave.text for each in (none, waits, done)] == ["&Leave", "&Leave", "&Close"]
    done.at.set(FIRST)
    assert buttons(done).leave.text == "&Leave"


@pytest.mark.parametrize("values", [{"look": Look("a", (BAD,))}, {"trouble": "No board was found."}])
def test_what_was_found_wrong_is_checked_before_it_is_captured(values: dict[str, Any]) -> None:
    assert main_button(wizard(FIRST, places_itself=True, **values)) == "check"
    assert main_button(wizard(FIRST, **values)) == "check"
    good: dict[str, Any] = {"look": Look("a", (GOOD,))}
    assert main_button(wizard(FIRST, places_itself=True, **good)) == "all"


@pytest.mark.parametrize("at", [FIRST, LAST])
def test_a_lost_device_is_connected_before_anything_else(at: int) -> None:
    state = wizard(at, places_itself=True)
    state.can_reconnect.set(True)
    shown = buttons(state)
    assert main_button(state) == "reconnect"
    assert not any(getattr(shown, each.name).is_primary for each in fields(Buttons))


def test_the_next_calibration_is_the_main_button_once_this_one_is_accepted() -> None:
    done = wizard(LAST, CAPTURED, fit=fit(GOOD, accepted=True))
    assert not buttons(done).following.is_visible
    assert buttons(done).leave.is_primary
    done.following, done.following_title = "geometry", "Geometry"
    shown = buttons(done)
    assert (shown.following.text, shown.following.is_primary) == ("&Next: Geometry…", True)
    assert not shown.leave.is_primary
    assert not buttons(wizard(LAST, CAPTURED, fit=fit(GOOD))).following.is_visible


def test_back_leads_from_the_settings_to_the_work() -> None:
    assert page_before(wizard(states=HALF)) == SECOND
    assert page_before(wizard(states=CAPTURED)) == LAST
    assert page_before(wizard(SECOND)) == FIRST


@pytest.mark.slow
def test_the_activity_is_what_runs_else_the_note() -> None:
    idle = wizard(note="Captured.", progress=JobProgress("old", 3, 4))
    assert (activity(idle).text, activity(idle).is_busy) == ("Captured.", False)
    looking = wizard(FIRST, doing=Doing.LOOKING, note="Captured.")
    assert (activity(looking).text, activity(looking).is_busy) == ("Captured.", False)
    told = {
        JobProgress(): "capturing",
        JobProgress("scan", 9, 40): "capturing · 9 of 40",
        JobProgress("white"): "white",
        JobProgress("white", 2, 8): "white · 2 of 8",
        JobProgress("white", 2, 8, 1.9): "white · 2 of 8",
        JobProgress("white", 2, 8, 44.0): "white · 2 of 8 · 44 s left",
    }
    for progress, text in told.items():
        shown = activity(wizard(FIRST, doing=Doing.CAPTURING, progress=progress))
        assert (shown.text, shown.is_busy) == (text, True)
        assert (shown.done, shown.total) == (progress.done, progress.total)
    stopping = activity(wizard(FIRST, doing=Doing.STOPPING, progress=JobProgress("white", 2, 8, 44.0)))
    assert stopping.text == "stopping at the next safe point"


def test_the_list_has_a_line_for_every_page() -> None:
    lines = page_lines(wizard(states=("captured", "refused"), fit=None))
    assert [line.text for line in lines] == ["✓  Step a", "✗  Step b", "○  Fit and judge", "⚙  Advanced"]
    assert [line.page for line in lines] == [1, 2, 3, 0]
    assert [line.role for line in lines] == ["good", "bad", "", "muted"]
    assert lines[1].tip == "Step b: it was moved"
    assert [line.accessible_text for line in lines] == [
        "Step a, captured", "Step b, refused", "Fit and judge, not fitted", "Advanced settings"
    ]  # fmt: skip
    fitted = page_lines(wizard(fit=fit(GOOD)))[-2]
    assert (fitted.text, fitted.role, fitted.tip) == ("✓  Fit and judge", "good", "Fit and judge: fitted")


def test_a_step_shows_what_to_place_and_what_the_look_found() -> None:
    assert step_display(wizard(SETTINGS)) is None
    assert step_display(wizard(LAST)) is None
    shown = step_display(wizard(SECOND, look=Look("b", (GOOD, FREE))))
    assert shown is not None
    assert (shown.title, shown.instruction, shown.placement.target) == ("Step b", "Place b.", "board")
    assert shown.figures == (GOOD, FREE)
    assert shown.points.legend == ()


def test_a_step_shows_where_the_target_is_wanted_and_what_was_found_of_it() -> None:
    found = ((1.0, 1.0), (9.0, 1.0), (9.0, 9.0))
    state = wizard(FIRST, outlines=OUTLINES, look=Look("a", (GOOD,), "", found), covered=((3.0, 4.0),))
    shown = step_display(state)
    assert shown is not None
    points = shown.points
    assert (points.wanted, points.found, points.covered) == (OUTLINES["a"], found, ((3.0, 4.0),))
    assert [words for words, _ in points.legend] == ["┅ wanted here", "● found", "● captured"]
    other = step_display(wizard(SECOND, outlines=OUTLINES))
    assert other is not None
    assert other.points.wanted == ()


@pytest.mark.parametrize(
    ("state", "start", "role"),
    [
        (wizard(FIRST), "Place the target", "muted"),
        (wizard(FIRST, is_checking=True), "Looking…", "muted"),
        (wizard(FIRST, look=Look("a", (GOOD,)), is_checking=True), "Everything is right", "good"),
        (
            wizard(FIRST, HALF, look=Look("a", (GOOD,))),
            "Everything is right. It is captured already",
            "good",
        ),
        (wizard(FIRST, outlines=OUTLINES), "Start the check, then bring the target into", "muted"),
        (wizard(FIRST, outlines=OUTLINES, captures_itself=False), "Place the target, then", "muted"),
        (
            wizard(FIRST, **AWAITED, look=Look("a", (GOOD,), shared=0.5)),
            "Well seen. Bring it into the dashed outline (50 %, wanted 80 %)",
            "warn",
        ),
        (
            wizard(FIRST, outlines=OUTLINES, is_checking=True, look=Look("a", (GOOD,), shared=0.9)),
            "Everything is right: capture.",
            "good",
        ),
        (
            wizard(FIRST, **AWAITED, look=Look("a", (GOOD,), shared=0.9)),
            "Everything is right. Keep it still",
            "good",
        ),
        (
            wizard(FIRST, outlines=OUTLINES, look=Look("a", (GOOD,), shared=0.5)),
            "Everything is right: capture",
            "good",
        ),
        (wizard(FIRST, look=Look("a", (BAD,))), "Not right yet", "warn"),
        (wizard(FIRST, look=Look("a", (), "No board.")), "No board.", "bad"),
        (wizard(FIRST, doing=Doing.CAPTURING, look=Look("a", (BAD,))), "Capturing. Do not touch", "warn"),
        (wizard(FIRST, doing=Doing.STOPPING), "Capturing. Do not touch", "warn"),
        (wizard(FIRST, HALF), "✓ Captured.", "good"),
        (wizard(SECOND, ("missing", "captured")), "✓ Captured, but it was moved.", "warn"),
        (wizard(SECOND, ("captured", "refused")), "✗ Refused: it was moved", "bad"),
    ],
)
def test_the_verdict_on_a_step(state: WizardState, start: str, role: str) -> None:
    shown = step_display(state)
    assert shown is not None
    assert shown.verdict.startswith(start)
    assert shown.role == role


@pytest.mark.parametrize(
    ("state", "verdict", "role"),
    [
        (wizard(LAST, CAPTURED, Doing.FITTING, fit=fit(BAD)), "Fitting…", "muted"),
        (wizard(LAST, HALF), "Not all steps are captured yet: Step b.", "warn"),
        (wizard(LAST, CAPTURED), "All steps are captured. Fit them to see how good they are.", "muted"),
        (
            wizard(LAST, CAPTURED, fit=fit(GOOD, FREE)),
            "✓ 1 of 1 figures are within their limits. Accept the fit to use it.",
            "good",
        ),
        (wizard(LAST, CAPTURED, fit=fit(GOOD, BAD)), "✗ 1 of 2 figures are within their limits.", "bad"),
        (
            wizard(LAST, CAPTURED, fit=fit(GOOD, accepted=True)),
            "✓ Accepted. 1 of 1 figures are within their limits.",
            "good",
        ),
        (
            wizard(LAST, CAPTURED, fit=fit(BAD, accepted=True)),
            "✓ Accepted. 0 of 1 figures are within their limits.",
            "warn",
        ),
    ],
)
def test_the_verdict_on_a_fit(state: WizardState, verdict: str, role: str) -> None:
    shown = fit_display(state)
    assert (shown.verdict, shown.role) == (verdict, role)


def test_many_missing_steps_are_not_all_named() -> None:
    state = wizard(LAST)
    state.statuses.set(tuple(status(key) for key in "abcdef"))
    shown = fit_display(state)
    assert shown.verdict == "Not all steps are captured yet: Step a, Step b, Step c, Step d and 2 more."


def test_only_a_waiting_fit_outside_its_limits_can_be_allowed() -> None:
    cases = {
        "none": wizard(LAST, CAPTURED),
        "good": wizard(LAST, CAPTURED, fit=fit(GOOD)),
        "bad": wizard(LAST, CAPTURED, fit=fit(BAD)),
        "allowed": wizard(LAST, CAPTURED, fit=fit(BAD), allowed=(BAD,)),
        "accepted": wizard(LAST, CAPTURED, fit=fit(BAD, accepted=True)),
    }
    shown = {name: fit_display(state) for name, state in cases.items()}
    assert [name for name, each in shown.items() if each.can_allow] == ["bad", "allowed"]
    assert [name for name, each in shown.items() if each.is_allowed] == ["allowed"]
    assert [name for name, each in shown.items() if not each.has_fit] == ["none"]
    assert all(each.can_edit for each in shown.values())
    assert not fit_display(wizard(LAST, CAPTURED, Doing.KEEPING, fit=fit(GOOD))).can_edit


def test_what_was_allowed_of_a_fit_is_not_allowed_of_the_next() -> None:
    state = wizard(LAST, CAPTURED, fit=fit(BAD), allowed=(BAD,))
    assert may_accept(state)
    state.fit.set(fit(BAD))
    assert may_accept(state), "the same figures, read again"
    worse = BAD.model_copy(update={"value": 0.9})
    state.fit.set(fit(worse))
    assert not may_accept(state)
    state.fit.set(fit(BAD))
    assert not may_accept(state), "the first figures again, after others"
    state.fit.set(fit(worse))
    state.allowed.set((worse,))
    state.fit.set(None)
    state.fit.set(fit(worse))
    assert not may_accept(state)


def test_what_stays_of_a_stopped_capture_is_said_as_it_is() -> None:
    state = WizardState("geometry", "Geometry")
    texts = leaving_text(state), stopped_text(state)
    assert all("Frames captured so far are kept" in text for text in texts)
    # A self-test is measured in one go.
    state.keeps_frames = False
    assert not any("are kept" in text for text in (leaving_text(state), stopped_text(state)))
    assert SelfTestRecipe.keeps_frames is False
