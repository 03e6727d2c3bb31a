"""What the controls of the Scan page say and allow in each state. No Qt."""

from __future__ import annotations

from dataclasses import dataclass

from dsl_app.scan.state import Facts, InterruptedScan, LivePicture, Phase, Reconnection
from dsl_app.shared.notify import NO_RIG, describe_seconds
from dsl_app.shared.widget_state import ButtonState, LabelState
from dsl_core.capture.runner import Status
from dsl_core.words import capitalised, counted

_PHASE_ROLES = {Phase.LOST: "bad", Phase.DONE: "good", Phase.PAUSED: "warn", Phase.STOPPED: "warn"}
#: Why there is nothing to pause or to cancel.
NO_SCAN = "No scan is running."
RESUME = "Resume at the first missing frame, after checking whether anything has moved"
RESTART = "Start the scan again from its first frame: none of it is saved yet"
RECONNECT = "Reconnect the rig, check whether anything has moved, and resume at the first missing frame"


@dataclass(frozen=True)
class RunControls:
    """The box that starts a scan; ``resume``, ``renew`` and ``drift`` are for one that was interrupted."""

    connect_rig: ButtonState
    start: ButtonState
    resume: ButtonState
    pause: ButtonState
    cancel: bool
    renew: ButtonState
    drift: ButtonState
    again: ButtonState
    phase: LabelState
    remarks: LabelState


@dataclass(frozen=True)
class BannerControls:
    """The banner of a scan that was interrupted, whose rig may have to be reconnected."""

    action: ButtonState
    stop: ButtonState


@dataclass(frozen=True)
class ProgressText:
    """Progress of a scan in words; both are empty before there is one."""

    frames: LabelState
    time: LabelState


@dataclass(frozen=True)
class FrameText:
    """How the last frame is exposed, how long one takes, and how many were captured again."""

    brightest: LabelState
    saturated: LabelState
    each: LabelState
    again: LabelState


def run_controls(
    phase: Phase,
    session: InterruptedScan | None,
    facts: Facts | None,
    note: str,
    has_finished: bool,
    has_result: bool = True,
    trouble: str = "",
    is_reconstructing: bool = False,
    must_calibrate: bool = False,
) -> RunControls:
    """The controls of a scan in a phase; ``note`` is what became of the last one.

    ``trouble`` is said in the banner, with how far the scan came; that is not said again. A finished scan
    without a result is reconstructed next, whatever kept it from having one, unless one ``must_calibrate``
    before; while one is, there is only to wait.
    """
    is_raw = phase is Phase.DONE and has_finished and not (has_result or is_reconstructing)
    obstacles = () if facts is None or phase.is_busy else facts.obstacles
    is_resumable = session is not None and not phase.is_busy
    lines = [*obstacles, *([note] if note else [])]
    if session is not None and is_resumable and not trouble:
        lines.insert(0, session.words)
    is_ready = phase is not Phase.PLANNING or not obstacles
    lacks_rig = NO_RIG in obstacles
    can_run, connects = not phase.is_busy and not obstacles, facts is not None and facts.connects
    why = "A scan is running." if phase.is_busy else " ".join(obstacles)
    return RunControls(
        connect_rig=ButtonState(lacks_rig, is_primary=True),
        start=ButtonState(
            session is None,
            can_run,
            is_primary=not (is_raw or lacks_rig or is_reconstructing or phase is Phase.PAUSED),
            why=why,
        ),
        resume=ButtonState(
            session is not None,
            can_run,
            is_primary=True,
            text="Co&nnect and resume" if connects else "Resume sca&n",
            tip=RECONNECT if connects else RESUME,
            why=why,
        ),
        pause=ButtonState(
            is_enabled=phase in (Phase.RUNNING, Phase.PAUSED),
            is_primary=phase is Phase.PAUSED,
            text="Cont&inue" if phase is Phase.PAUSED else "&Pause",
            why=NO_SCAN,
        ),
        cancel=phase.is_busy and phase is not Phase.STOPPING,
        renew=ButtonState(is_resumable),
        drift=ButtonState(is_resumable),
        again=ButtonState(
            has_finished and not phase.is_busy and session is None,
            is_primary=is_raw and not must_calibrate,
            text="Reconstruct…" if is_raw else "Reconstruct a&gain…",
        ),
        phase=LabelState(f"● {phase.value}" if is_ready else "● not ready", _PHASE_ROLES.get(phase, "muted")),
        remarks=LabelState("\n".join(lines), "warn" if obstacles else "muted"),
    )


def banner_controls(reconnection: Reconnection, has_frames: bool = True) -> BannerControls:
    """What the banner offers while a lost rig is reconnected; without frames there is nothing to resume."""
    is_away = reconnection.is_away
    again, tip = ("resume", RECONNECT if is_away else RESUME) if has_frames else ("start again", RESTART)
    return BannerControls(
        action=ButtonState(
            is_enabled=reconnection is not Reconnection.RESUMING,
            text=f"Connect and {again}" if is_away else capitalised(again),
            tip=tip,
        ),
        stop=ButtonState(reconnection.is_trying),
    )


def progress_text(status: Status) -> ProgressText:
    """How many frames are saved, and how long that took and will take."""
    if status.total <= 0:
        return ProgressText(LabelState(), LabelState())
    spent, left = describe_seconds(status.elapsed_s), describe_seconds(status.remaining_s)
    took, so_far = f"took {spent}", f"{spent} so far"
    if status.earlier:
        # A run does not know how long those before it took.
        took = so_far = f"{counted(status.done - status.earlier, 'frame')} {took}"
    time = took if status.state.is_final else f"{so_far}, {left} left"
    return ProgressText(
        LabelState(f"{status.done} of {status.total} frames saved", "muted"), LabelState(time, "muted")
    )


def frame_text(status: Status, shown: LivePicture | None) -> FrameText:
    """The last frame in words; a dash for what is not known."""
    left = status.total - status.done
    each = f"{status.remaining_s / left:.2g} s" if left and status.remaining_s else "–"
    again = LabelState("none", "muted")
    if status.corrected:
        again = LabelState(f"{status.corrected}: a picture did not show its pattern", "warn")
    if shown is None:
        return FrameText(LabelState("–"), LabelState("–"), LabelState(each), again)
    return FrameText(
        LabelState(f"{100 * shown.brightest:.0f} % of full scale"),
        LabelState(f"{100 * shown.saturated:.1f} % of the pixels"),
        LabelState(each),
        again,
    )
