"""What a wizard's window shows, computed from its state; its widgets only set it. No Qt."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from dsl_app.calibrate.wizard.ghost import LEAST_SHARED, PointsPx
from dsl_app.calibrate.wizard.state import Doing, Fit, Look, WizardState
from dsl_app.shared.jobs.base import JobProgress
from dsl_app.shared.notify import describe_seconds
from dsl_app.shared.widget_state import ButtonState
from dsl_core.campaign.session import State, StepStatus
from dsl_core.model.figure import Figure, failures
from dsl_core.model.placement import Placement

#: A sentence and its role of the style sheet.
Verdict = tuple[str, str]
#: The buttons of which one is the main one at any time.
Main = Literal["reconnect", "back", "next", "all", "check", "capture", "fit", "accept", "following", "leave"]
#: The page of the settings, and that of the first step.
SETTINGS_PAGE, FIRST_PAGE = 0, 1
NO_PICTURE = "No picture yet. It comes with the first check."
READING = "Reading the picture…"
NONE_KEPT = "Figures of this step are kept, and no picture. A check shows what the camera sees now."
ADVANCED_TIP = "Settings of this calibration: the target's size, distances, how much is captured"
_MARKS: dict[State, str] = {"missing": "○", "captured": "✓", "refused": "✗"}
_MARK_ROLES = {"✓": "good", "✗": "bad"}


# The buttons -----------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Buttons:
    """The row of buttons below every page; one is primary, which the return key presses.

    None is while a device is lost: its message has the button that continues.
    """

    leave: ButtonState
    back: ButtonState
    itself: ButtonState
    check: ButtonState
    all: ButtonState
    capture: ButtonState
    stop: ButtonState
    next: ButtonState
    discard: ButtonState
    fit: ButtonState
    accept: ButtonState
    following: ButtonState


def buttons(state: WizardState) -> Buttons:
    """The buttons of the current page."""
    doing, fit, main = state.doing.value, state.fit.value, main_button(state)
    on_fit, on_step, idle = state.at.value == state.last, state.status is not None, not doing.is_long
    on_settings = state.at.value == SETTINGS_PAGE
    can_stop = doing in (Doing.CAPTURING, Doing.FITTING, Doing.STOPPING)
    has_candidate = fit is not None and not fit.is_accepted
    is_done = on_fit and fit is not None and fit.is_accepted
    capture, capture_tip = _capture_text(state)
    return Buttons(
        leave=ButtonState(is_primary=main == "leave", text="&Close" if is_done else "&Leave"),
        back=ButtonState(is_enabled=state.at.value != FIRST_PAGE and idle, is_primary=main == "back"),
        itself=ButtonState(state.waits_for_person and not can_stop, idle),
        check=ButtonState(on_step and not can_stop, idle, main == "check"),
        all=ButtonState(
            state.places_itself.value and bool(state.lacking) and not can_stop, idle, main == "all"
        ),
        capture=ButtonState(on_step and not can_stop, idle, main == "capture", capture, capture_tip),
        stop=ButtonState(can_stop, doing is not Doing.STOPPING),
        next=ButtonState(not on_fit and not on_settings, idle, main == "next"),
        discard=ButtonState(on_fit and has_candidate and not can_stop, idle),
        fit=ButtonState(
            on_fit and not can_stop,
            idle and not state.lacking,
            main == "fit",
            "&Fit" if fit is None else "&Fit again",
        ),
        accept=ButtonState(on_fit and not can_stop, idle and state.may_accept, main == "accept"),
        following=ButtonState(
            is_done and bool(state.following), idle, main == "following", f"&Next: {state.following_title}…"
        ),
    )


def main_button(state: WizardState) -> Main:
    """The button that continues from the current page, or that of the message of a lost device."""
    if state.can_reconnect.value:
        return "reconnect"
    status, fit = state.status, state.fit.value
    if status is not None and status.state != "captured":
        if state.trouble.value or (state.look.value is not None and not state.look.value.is_good):
            return "check"  # what was wrong is right now, or not
        if state.places_itself.value:
            return "all"
        has_looked = state.is_checking.value or state.look.value is not None
        return "check" if state.waits_for_person and not has_looked else "capture"
    if state.at.value == SETTINGS_PAGE:
        return "back"
    if state.at.value != state.last:
        return "next"
    if fit is None and state.lacking:
        return "all" if state.places_itself.value else "back"
    if fit is None:
        return "fit"
    if not fit.is_accepted:
        return "accept"
    return "following" if state.following else "leave"


def page_before(state: WizardState) -> int:
    """The page that *Back* shows: that of the work from the settings, else the one before."""
    at = state.at.value
    return next(iter(state.lacking), state.last) if at == SETTINGS_PAGE else at - 1


def _capture_text(state: WizardState) -> tuple[str, str]:
    status, look = state.status, state.look.value
    if status is not None and status.state == "captured":
        return "&Redo this step", "Capture it again; the old capture is kept until the new one is complete"
    if look is not None and not look.is_good:
        return "&Capture anyway", "Capture although the look found something wrong"
    return "&Capture", "Capture this step; everything is saved to disk at once"


@dataclass(frozen=True)
class Activity:
    """The line above the buttons; ``total`` 0 means that the end is not known."""

    text: str
    is_busy: bool = False
    done: int = 0
    total: int = 0


def activity(state: WizardState) -> Activity:
    """What the wizard is doing, else what it did last."""
    doing, told = state.doing.value, state.progress.value
    if not doing.is_long:
        return Activity(state.note.value, done=told.done, total=told.total)
    return Activity(_activity_text(doing, told), True, told.done, told.total)


def _activity_text(doing: Doing, told: JobProgress) -> str:
    if doing is Doing.STOPPING:
        return "stopping at the next safe point"
    # Frames are captured by what captures scans, and nobody scans here.
    parts = [doing.value if told.stage in ("", "scan") else told.stage]
    if told.total:
        parts.append(f"{told.done} of {told.total}")
        if told.remaining_s is not None and told.remaining_s >= 2:
            parts.append(f"{describe_seconds(told.remaining_s)} left")
    return " · ".join(parts)


# The list of pages -----------------------------------------------------------------------------------


@dataclass(frozen=True)
class PageLine:
    """A line of the list at the left for a page; ``role`` colours it, empty for plain text."""

    page: int
    text: str
    tip: str
    accessible_text: str
    role: str = ""


def page_lines(state: WizardState) -> tuple[PageLine, ...]:
    """Steps with their state, fit, and last the settings, which few people change."""
    has_fit = state.fit.value is not None
    lines = [
        _line(page, _MARKS[s.state], s.step.title, s.state, s.reason)
        for page, s in enumerate(state.statuses.value, FIRST_PAGE)
    ]
    fitted = "fitted" if has_fit else "not fitted"
    fit = _line(state.last, "✓" if has_fit else "○", "Fit and judge", fitted)
    return (*lines, fit, PageLine(SETTINGS_PAGE, "⚙  Advanced", ADVANCED_TIP, "Advanced settings", "muted"))


def _line(page: int, mark: str, title: str, state: str, reason: str = "") -> PageLine:
    role = _MARK_ROLES.get(mark, "")
    return PageLine(page, f"{mark}  {title}", f"{title}: {reason or state}", f"{title}, {state}", role)


# A step ----------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class StepDisplay:
    """What to place where, what the look found, and whether that is right."""

    title: str
    instruction: str
    placement: Placement
    figures: tuple[Figure, ...]
    points: Points
    verdict: str
    role: str
    why_no_picture: str


@dataclass(frozen=True)
class Points:
    """What is drawn over the camera's picture, px: the outline that is wanted, what was found, what is done.

    ``legend`` names what there is of them, with the role of its colour in the theme.
    """

    wanted: PointsPx = ()
    found: PointsPx = ()
    covered: PointsPx = ()

    @property
    def legend(self) -> tuple[tuple[str, str], ...]:
        """Words and their roles."""
        every = (
            (self.wanted, "┅ wanted here", "accent"),
            (self.found, "● found", "good"),
            (self.covered, "● captured", "muted"),
        )
        return tuple((words, role) for points, words, role in every if points)


def step_display(state: WizardState) -> StepDisplay | None:
    """The step that is shown; None on the pages of settings and fit."""
    status, look = state.status, state.look.value
    if status is None:
        return None
    step = status.step
    figures = () if look is None else look.figures
    found = () if look is None else look.points_px
    points = Points(state.outline, found, state.covered.value)
    why = _why_no_picture(state, status)
    return StepDisplay(
        step.title, step.instruction, step.placement, figures, points, *_step_verdict(state), why
    )


def _why_no_picture(state: WizardState, status: StepStatus) -> str:
    if state.doing.value is Doing.READING:
        return READING
    return NONE_KEPT if status.state == "captured" else NO_PICTURE


def _step_verdict(state: WizardState) -> Verdict:
    status, look = state.status, state.look.value
    if state.doing.value in (Doing.CAPTURING, Doing.STOPPING):
        return "Capturing. Do not touch anything until it is done.", "warn"
    if look is not None and look.trouble:
        return look.trouble, "bad"
    if look is not None and look.is_good:
        return _verdict_on_good(state, look)
    if look is not None:
        return "Not right yet; the table says what to do.", "warn"
    if state.is_checking.value:
        return "Looking…", "muted"
    if status is not None and status.state == "captured":
        if status.reason:
            return f"✓ Captured, but {status.reason}.", "warn"
        return "✓ Captured. If you redo it, the old capture is kept until the new one is complete.", "good"
    if status is not None and status.state == "refused":
        return f"✗ Refused: {status.reason}", "bad"
    if state.waits_for_person and state.captures_itself.value:
        return (
            "Start the check, then bring the target into the dashed outline: once it is right and still, it"
            " is captured by itself."
        ), "muted"
    return "Place the target, then check that it is right, or capture at once.", "muted"


def _verdict_on_good(state: WizardState, look: Look) -> Verdict:
    if state.status is not None and state.status.state == "captured":
        return "Everything is right. It is captured already; redo it only if the target was moved.", "good"
    if not state.will_capture_itself:
        return "Everything is right: capture.", "good"
    if look.is_in_place:
        return "Everything is right. Keep it still: it is captured by itself.", "good"
    share = f"{100 * look.shared:.0f} %, wanted {100 * LEAST_SHARED:.0f} %"
    return (
        f"Well seen. Bring it into the dashed outline ({share}) and keep it still, or capture here.",
        "warn",
    )


# The fit ---------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class FitDisplay:
    """The verdict on a fit, its figures, and whether a person may allow those outside their limits."""

    verdict: str
    role: str
    figures: tuple[Figure, ...] = ()
    has_fit: bool = False
    can_allow: bool = False
    is_allowed: bool = False
    can_edit: bool = True


def fit_display(state: WizardState) -> FitDisplay:
    """The page of the fit; while something runs its evidence cannot be edited."""
    fit, can_edit = state.fit.value, not state.doing.value.is_long
    verdict, role = _fit_verdict(state)
    if fit is None:
        return FitDisplay(verdict, role, can_edit=can_edit)
    figures = fit.fitted.figures
    can_allow = not fit.is_accepted and bool(failures(figures))
    is_allowed = can_allow and state.allowed.value == figures
    return FitDisplay(verdict, role, figures, True, can_allow, is_allowed, can_edit)


def _fit_verdict(state: WizardState) -> Verdict:
    fit, lacking = state.fit.value, state.lacking
    if state.doing.value is Doing.FITTING:
        return "Fitting…", "muted"
    if fit is not None:
        return _verdict_on(fit)
    if not lacking:
        return "All steps are captured. Fit them to see how good they are.", "muted"
    titles = [state.statuses.value[page - 1].step.title for page in lacking]
    named = ", ".join(titles[:4]) + (f" and {len(titles) - 4} more" if len(titles) > 4 else "")
    return f"Not all steps are captured yet: {named}.", "warn"


def _verdict_on(fit: Fit) -> Verdict:
    limited = [figure for figure in fit.fitted.figures if figure.limits]
    wrong = len(failures(fit.fitted.figures))
    count = f"{len(limited) - wrong} of {len(limited)} figures are within their limits."
    if fit.is_accepted:
        return f"✓ Accepted. {count}", "warn" if wrong else "good"
    return (f"✗ {count}", "bad") if wrong else (f"✓ {count} Accept the fit to use it.", "good")


def leaving_text(state: WizardState) -> str:
    """What is asked before a capture or fit is stopped and the wizard left, and what of it stays."""
    stays = "Frames captured so far are kept, and the wizard continues from here next time."
    if not state.keeps_frames:
        stays = "What is captured completely is kept; the rest starts from its beginning next time."
    return f"Stop it and leave? {stays}"


def stopped_text(state: WizardState) -> str:
    """What is said after a capture was stopped."""
    if state.keeps_frames:
        return "Stopped. Frames captured so far are kept; capture again to continue."
    return "Stopped. This capture is not kept; capture again from its beginning."
