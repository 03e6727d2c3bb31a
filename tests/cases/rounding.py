"""A camera that rounds exposures, as many do."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from dsl_core.devices.base import Camera, CameraInfo
from dsl_core.model.frames import Frame


@dataclass
class Rounding(Camera):
    """Another camera with exposures that are longer than those wanted, and says so."""

    camera: Camera
    longer: Callable[[float], float]

    @property
    def info(self) -> CameraInfo:
        return self.camera.info

    def configure(self, exposure_ms: float) -> float:
        return self.camera.configure(self.longer(exposure_ms) * exposure_ms)

    def prepare(self, shot_index: int, attempt: int = 0) -> None:
        self.camera.prepare(shot_index, attempt)

    def snap(self, timeout_ms: float = 5000.0) -> Frame:
        return self.camera.snap(timeout_ms)
