"""What the controls of the Scan page say and allow in each state. No Qt."""

from __future__ import annotations

from dataclasses import dataclass

from dsl_app.scan.state import Facts, InterruptedScan, Phase, Reconnection
from dsl_app.shared.notify import describe_seconds
from dsl_core.capture.runner import Status

_PHASE_ROLES = {Phase.LOST: "bad", Phase.DONE: "good", Phase.PAUSED: "warn", Phase.STOPPED: "warn"}
RESUME = "Resume at the first missing frame, after checking whether anything has moved"
RECONNECT = "Reconnect the rig, check whether anything has moved, and resume at the first missing frame"


@dataclass(frozen=True)
class RunControls:
    """The box that starts a scan. Roles are those of the theme: good, warn, bad, muted."""

    start: str
    can_start: bool
    pause: str
    can_pause: bool
    can_cancel: bool
    #: Whether an interrupted scan can be resumed or left for a new one.
    is_resumable: bool
    can_reconstruct_again: bool
    phase: str
    phase_role: str
    remarks: str
    remarks_role: str


@dataclass(frozen=True)
class BannerControls:
    """The banner of a scan that was interrupted, whose rig may have to be reconnected."""

    action: str
    tip: str
    is_enabled: bool
    can_stop: bool


@dataclass(frozen=True)
class ProgressText:
    """Progress of a scan in words; both are empty before there is one."""

    frames: str
    time: str


def run_controls(
    phase: Phase, session: InterruptedScan | None, facts: Facts | None, note: str, has_finished: bool
) -> RunControls:
    """The controls of a scan in a phase; ``note`` is what became of the last one."""
    obstacles = () if facts is None or phase.is_busy else facts.obstacles
    is_resumable = session is not None and not phase.is_busy
    lines = [*obstacles, *([note] if note else [])]
    if session is not None and is_resumable:
        lines.insert(0, f"{session.folder.name} contains {session.done} of {session.total} frames.")
    is_ready = phase is not Phase.PLANNING or not obstacles
    return RunControls(
        start="&Start scan" if session is None else "&Resume scan",
        can_start=not phase.is_busy and not obstacles,
        pause="&Continue" if phase is Phase.PAUSED else "&Pause",
        can_pause=phase in (Phase.RUNNING, Phase.PAUSED),
        can_cancel=phase.is_busy and phase is not Phase.STOPPING,
        is_resumable=is_resumable,
        can_reconstruct_again=has_finished and not phase.is_busy,
        phase=f"● {phase.value}" if is_ready else "● not ready",
        phase_role=_PHASE_ROLES.get(phase, "muted"),
        remarks="\n".join(lines),
        remarks_role="warn" if obstacles else "muted",
    )


def banner_controls(reconnection: Reconnection) -> BannerControls:
    """What the banner offers while a lost rig is reconnected."""
    is_away = reconnection.is_away
    return BannerControls(
        action="Reconnect and resume" if is_away else "Resume",
        tip=RECONNECT if is_away else RESUME,
        is_enabled=reconnection is not Reconnection.RESUMING,
        can_stop=reconnection.is_trying,
    )


def progress_text(status: Status) -> ProgressText:
    """How many frames are saved, and how long that took and will take."""
    if status.total <= 0:
        return ProgressText("", "")
    spent, left = describe_seconds(status.elapsed_s), describe_seconds(status.remaining_s)
    return ProgressText(
        f"{status.done} of {status.total} frames saved",
        f"took {spent}" if status.state.is_final else f"{spent} so far, {left} left",
    )
