"""What a library has to offer so that `GenicamCamera` can use its cameras: features by name, and frames."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol


@dataclass(frozen=True)
class RawFrame:
    """A frame as a library delivers it, copied out of its buffer.

    ``fault`` says why it must not be used, such as lost packets; empty for a whole one.
    """

    data: bytes
    width: int
    height: int
    pixel_format: str
    frame_id: int
    fault: str = ""


class GenicamPort(Protocol):
    """An open camera of some library. Every method may raise `DeviceError`."""

    @property
    def model(self) -> str:
        """Maker and model."""

    @property
    def serial(self) -> str:
        """Serial number, or what else tells it from others of its model."""

    def has(self, feature: str) -> bool:
        """Whether the camera has a feature, now."""

    def can_write(self, feature: str) -> bool:
        """Whether a feature can be set now."""

    def choices(self, feature: str) -> list[str]:
        """Values that a feature of named values can have now."""

    def read(self, feature: str) -> float | str:
        """A feature's value: a number for numbers and switches (0 or 1), else its name."""

    def write(self, feature: str, value: float | str) -> None:
        """Set a feature."""

    def bounds(self, feature: str) -> tuple[float, float]:
        """Smallest and largest value of a number."""

    def execute(self, command: str) -> None:
        """Do what a command feature does, such as ``TriggerSoftware``."""

    def start(self) -> None:
        """Begin to acquire: frames come when they are triggered."""

    def stop(self) -> None:
        """End to acquire, and drop all frames that were not fetched."""

    def wait_ready(self, timeout_s: float) -> bool:
        """Wait until the camera takes a trigger; True also where it does not say."""

    def fetch(self, timeout_s: float) -> RawFrame | None:
        """The next frame, a bad one too; None when none arrives in time."""

    def close(self) -> None:
        """Release the camera; a lost one too, and a second time."""
