"""The rig as the window knows it: which one, whether it is there, what it sees."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from app.state.evented import Value
from dsl_core.devices.base import CameraInfo, DeviceRig, ProjectorInfo
from dsl_core.model.frames import Frame


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
        parts = [f"--rig {self.name}", *(f"--option {key}={value}" for key, value in self.options)]
        return " ".join(parts)

    @property
    def words(self) -> str:
        """How people read it, such as ``twin, scene plane``."""
        return ", ".join((self.name, *(f"{key} {value}" for key, value in self.options)))


class RigState:
    """Values that the rig's controller sets and pages follow.

    ``frame`` is the latest live frame; ``trouble`` a sentence on why the rig is not there (empty: nothing).
    """

    def __init__(self, choice: RigChoice) -> None:
        self.choice = Value(choice)
        self.link = Value(Link.CLOSED)
        self.devices: Value[DeviceRig | None] = Value(None)
        self.trouble = Value("")
        self.live = Value(False)
        self.frame: Value[Frame | None] = Value(None)
        self.exposure_ms = Value(1000.0 / 6.0)

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
