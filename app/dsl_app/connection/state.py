"""The window's view of the rig: which one, whether it is connected, what uses it."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING

from dsl_app.shared.evented import Value
from dsl_core.words import quoted

if TYPE_CHECKING:
    # The window comes up before numpy.
    from dsl_core.devices.base import CameraInfo, DeviceRig, ProjectorInfo


class Link(Enum):
    """Whether the devices answer."""

    CLOSED = "not connected"
    OPENING = "connecting"
    OPEN = "connected"
    LOST = "lost"


@dataclass(frozen=True)
class RigChoice:
    """A rig by name with its options, as the command line takes them."""

    name: str
    options: tuple[tuple[str, str], ...] = ()

    @property
    def command(self) -> str:
        """How the command line names it."""
        parts = [f"--rig {quoted(self.name)}"]
        parts += [f"--option {quoted(f'{key}={value}')}" for key, value in self.options]
        return " ".join(parts)

    @property
    def words(self) -> str:
        """How people read it, such as ``twin, scene plane``."""
        return ", ".join((self.name, *(f"{key} {value}" for key, value in self.options)))


class RigState:
    """Values that the rig's controller sets and pages follow.

    ``usable`` is what there is to measure with: ``devices``, but nothing of a lost rig until it is connected
    again. ``trouble`` is a sentence on why the rig is not connected (empty: nothing). ``live`` says whether a
    live view uses the rig, which gives way to jobs. ``used_by`` names the job that uses the rig alone and
    whose frames another picture would spoil (empty: none).
    """

    def __init__(self, choice: RigChoice) -> None:
        self.choice = Value(choice)
        self.link = Value(Link.CLOSED)
        self.devices: Value[DeviceRig | None] = Value(None)
        self.usable: Value[DeviceRig | None] = Value(None)
        self.devices.changed.connect(self.usable.set)
        self.link.changed.connect(lambda link: self.usable.set(None) if link is Link.LOST else None)
        self.trouble = Value("")
        self.live = Value(False)
        self.used_by = Value("")

    @property
    def camera(self) -> CameraInfo | None:
        """What the camera is; None while there is none."""
        devices = self.devices.value
        return None if devices is None else devices.camera.info

    @property
    def projector(self) -> ProjectorInfo | None:
        """What the projector is; None while there is none."""
        devices = self.devices.value
        return None if devices is None else devices.projector.info

    @property
    def cycle_ms(self) -> float | None:
        """The projector's colour cycle, as the self-test found it, else as its driver says; None without."""
        devices = self.devices.value
        if devices is None:
            return None
        known = devices.calibration
        return devices.projector.info.frame_period_ms if known is None else known.frame_period_ms
