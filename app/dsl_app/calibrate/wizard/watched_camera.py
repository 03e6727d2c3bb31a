"""A camera that lets the window see what it takes."""

from __future__ import annotations

import threading
import time

import numpy as np

from dsl_core.devices.base import Camera, CameraInfo
from dsl_core.model.frames import Frame

#: Frames darker than so much of the brightest lately are those between patterns; they would only flicker.
DARK_SHARE = 0.5
#: A frame with a larger share of saturated pixels is shown only where there is no other.
MANY_SATURATED = 0.005
#: How long the brightest frame is remembered, s.
MEMORY_S = 3.0


class WatchedCamera(Camera):
    """Passes every verb on and keeps the latest frame worth looking at."""

    def __init__(self, camera: Camera) -> None:
        self._camera = camera
        self._lock = threading.Lock()
        self._frame: Frame | None = None
        self._best, self._best_at = 0.0, 0.0

    @property
    def info(self) -> CameraInfo:
        """That of the camera."""
        return self._camera.info

    def configure(self, exposure_ms: float) -> float:
        """Set the exposure."""
        return self._camera.configure(exposure_ms)

    def prepare(self, shot_index: int, attempt: int = 0) -> None:
        """Tell what the next frame is for."""
        self._camera.prepare(shot_index, attempt)

    def snap(self, timeout_ms: float = 5000.0) -> Frame:
        """Take a frame and keep it to be looked at."""
        frame = self._camera.snap(timeout_ms)
        worth, now = self._worth(frame), time.monotonic()
        with self._lock:
            if worth > self._best or now - self._best_at > MEMORY_S:
                self._best, self._best_at = worth, now
            if worth >= DARK_SHARE * self._best:
                self._frame = frame
        return frame

    def _worth(self, frame: Frame) -> float:
        """How well a frame shows the target: bright, but not saturated."""
        thin = frame.pixels[::7, ::7]
        saturated = float(np.mean(thin >= 2**self.info.bit_depth - 1))
        return float(np.mean(thin)) * (0.01 if saturated > MANY_SATURATED else 1.0)

    def take_frame(self) -> Frame | None:
        """The latest frame since last time; None without one."""
        with self._lock:
            frame, self._frame = self._frame, None
        return frame

    def close(self) -> None:
        """Close the camera."""
        self._camera.close()
