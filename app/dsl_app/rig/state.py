"""What the camera shows live, and what the Rig page makes of it: its labels and which buttons work. No Qt."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias

from dsl_app.connection.state import Link, RigState
from dsl_app.shared.evented import Value
from dsl_app.shared.widget_state import ButtonState, LabelState
from dsl_core.words import counted

if TYPE_CHECKING:
    # The window comes up before numpy.
    import numpy as np
    from numpy.typing import NDArray

    from dsl_core.devices.base import CameraInfo, ProjectorInfo
    from dsl_core.model.frames import Frame

#: From the mosaic of a frame to a picture (rows, columns, 3) of bytes; runs in any thread.
Draw: TypeAlias = "Callable[[NDArray[np.uint16]], NDArray[np.uint8]]"
#: How a picture was drawn, and the picture.
Drawn: TypeAlias = "tuple[Draw, NDArray[np.uint8]]"
#: Drive level of the first trial picture.
LEVEL = 0.8
#: What is wrong with a part of an LED cycle.
COLOURS_VARY = "colours vary"
_LINK_ROLES = {Link.OPEN: "good", Link.OPENING: "warn", Link.LOST: "bad", Link.CLOSED: "muted"}

CONNECT_FIRST = "Connect a rig first."
CONNECT = "Open or close the devices of this rig"
CONNECT_OTHER = "Close the rig that is connected, and open the one that the form shows now"
_LINK_BUTTONS = {Link.OPEN: "Disconnect", Link.OPENING: "Connecting…"}


@dataclass(frozen=True)
class FrameCounts:
    """Live frames so far: shown, lost on the way from the camera, and skipped because the window was busy."""

    shown: int = 0
    lost: int = 0
    skipped: int = 0


class LiveState:
    """Values of the live view: the latest frame, its exposure, and whether an exposure is being searched.

    ``draw`` is how the page shows frames (None before it does), and ``drawn`` the picture of ``frame``, made
    in the thread of the camera. ``level`` is the drive level of the trial picture.
    """

    def __init__(self) -> None:
        self.frame: Value[Frame | None] = Value(None)
        self.draw: Value[Draw | None] = Value(None)
        self.drawn: Drawn | None = None
        self.exposure_ms = Value(1000.0 / 6.0)
        self.counts = Value(FrameCounts())
        self.is_exposing = Value(False)
        self.level = Value(LEVEL)


@dataclass(frozen=True)
class RigView:
    """What the Rig page shows of devices and live view, besides the picture."""

    link: LabelState
    trouble: LabelState
    camera_text: str
    projector_text: str
    connect_button: ButtonState
    live_button: ButtonState
    selftest: ButtonState
    scan: ButtonState
    exposure: bool
    auto: bool
    cycles: LabelState


def rig_view(
    rig: RigState, live: LiveState, is_other: bool = False, is_of_other_rig: bool = False
) -> RigView:
    """Texts and buttons of the Rig page for what is known now.

    While the form ``is_other`` than the rig that is connected, connecting that comes next: what the form
    shows is not what the camera sees. Once the picture is live, the next thing is a scan on a calibrated
    rig, and the self-test on any other. What went wrong is said while the form shows the rig it happened to,
    and not where it ``is_of_other_rig``.
    """
    link, devices = rig.link.value, rig.devices.value
    has_devices = devices is not None
    can_look = rig.usable.value is not None
    cycles = cycles_text(live.exposure_ms.value, rig.cycle_ms)
    is_other = is_other and link is Link.OPEN
    is_live, is_calibrated = rig.live.value, devices is not None and devices.calibration is not None
    return RigView(
        link=LabelState(f"● {link.value}", _LINK_ROLES[link]),
        trouble=LabelState("" if is_of_other_rig else rig.trouble.value, "bad"),
        camera_text=_describe(rig.camera),
        projector_text=_describe(rig.projector),
        connect_button=ButtonState(
            is_enabled=link is not Link.OPENING,
            is_primary=link is not Link.OPEN or is_other,
            text="Connect" if is_other else _LINK_BUTTONS.get(link, "Connect"),
            tip=CONNECT_OTHER if is_other else CONNECT,
        ),
        live_button=ButtonState(
            is_enabled=can_look,
            is_primary=can_look and not is_live and not is_other,
            text="Stop live view" if is_live else "Start live view",
            why=CONNECT_FIRST,
        ),
        selftest=ButtonState(
            is_enabled=can_look,
            is_primary=is_live and not (is_calibrated or is_other),
            why=CONNECT_FIRST,
        ),
        scan=ButtonState(
            is_enabled=can_look, is_primary=is_live and is_calibrated and not is_other, why=CONNECT_FIRST
        ),
        exposure=has_devices,
        auto=can_look and not live.is_exposing.value,
        cycles=LabelState(cycles, "warn" if cycles.endswith(COLOURS_VARY) else "muted"),
    )


def _describe(info: CameraInfo | ProjectorInfo | None) -> str:
    return "–" if info is None else f"{info.model}\n{info.width_px} × {info.height_px} px"


def exposure_text(exposure_ms: float) -> str:
    """An exposure as a person says it.

    >>> exposure_text(1000 / 60), exposure_text(17016.7)
    ('16.67 ms', '17.02 s')
    """
    return f"{exposure_ms:.4g} ms" if exposure_ms < 1000 else f"{exposure_ms / 1000:.4g} s"


def cycles_text(exposure_ms: float, cycle_ms: float | None) -> str:
    """How many LED cycles an exposure holds, and what is wrong with a part of one.

    >>> cycles_text(50.0, 1000 / 60)
    '3 LED cycles'
    """
    if not cycle_ms:
        return ""
    cycles = exposure_ms / cycle_ms
    whole = round(cycles)
    # The box rounds to a hundredth of a millisecond.
    if whole and abs(exposure_ms - whole * cycle_ms) < 0.006:
        return counted(whole, "LED cycle")
    return f"{cycles:.2f} LED cycles: {COLOURS_VARY}"


NO_RIG = "No picture yet. Connect a rig and start the live view."
NO_PICTURE = "No picture yet. Start the live view."
#: A simulated rig of the full size computes for seconds before it has the first one.
WAITING = "Waiting for the camera's first picture…"
STOPPED = "The live view is stopped. This is its last picture."
LOST = "The rig is lost. Connect it again."
LOST_PICTURE = "The rig is lost: this is its last picture. Connect it again."
#: How long no frame may come before the rate is no longer true, s, and how many usual pauses between frames.
SILENT_S, SILENT_PAUSES = 2.0, 4.0


def picture_note(rig: RigState, has_picture: bool) -> LabelState:
    """What is said over the live picture, empty while that is live; ``has_picture``: one is shown."""
    link = rig.link.value
    if link is Link.OPENING:
        return LabelState(f"Connecting {rig.choice.value.words}…", "muted")
    if link is Link.LOST:
        return LabelState(LOST_PICTURE if has_picture else LOST, "bad")
    if rig.camera is None:
        return LabelState(NO_RIG, "muted")
    if rig.live.value:
        return LabelState("" if has_picture else WAITING, "muted")
    return LabelState(STOPPED if has_picture else NO_PICTURE, "muted")


def rate_text(times_s: Sequence[float], now_s: float, is_live: bool) -> str:
    """How often frames come that came at these times, or for how long none has come; empty while not live.

    >>> rate_text([0.0, 0.1, 0.2], 0.25, True), rate_text([0.0, 0.1, 0.2], 7.2, True)
    ('10 frames/s', 'no frame for 7 s')
    """
    if not is_live or not times_s:
        return ""
    pause_s = (times_s[-1] - times_s[0]) / max(len(times_s) - 1, 1)
    silent_s = now_s - times_s[-1]
    if silent_s > max(SILENT_S, SILENT_PAUSES * pause_s):
        return f"no frame for {silent_s:.0f} s"
    if not pause_s:
        return ""
    return f"{1 / pause_s:.0f} frames/s" if pause_s <= 1 else f"a frame every {pause_s:.1f} s"


@dataclass(frozen=True)
class PanelView:
    """What the projector panel lets one do, and the note below it."""

    can_show: bool
    can_choose_screen: bool
    note: str


def panel_view(info: ProjectorInfo | None, user: str) -> PanelView:
    """The panel for a projector (None: not connected) that a job of this title uses (empty: none)."""
    if user:
        note = f"{user} is using the projector. Pictures can be shown when it has ended."
    elif info is None:
        note = "No projector is connected. Connect a rig to show pictures."
    else:
        note = f"{info.model}, {info.width_px} × {info.height_px} logical pixels"
    return PanelView(info is not None and not user, not user, note)
