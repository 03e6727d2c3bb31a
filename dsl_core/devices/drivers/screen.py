"""A projector that is a screen: a window with exact pixels on it, in a program of its own.

The engine knows no window. So the window runs as ``dsl_app.rig.projector_process``, on a desktop beside the
operator's screen, or on a server whose only screen is the projector. Patterns go to it through a pipe, and it
answers when they are painted, by the clock of `time.monotonic`.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from dsl_core.devices.base import Projector, ProjectorInfo
from dsl_core.devices.driver_table import Driver
from dsl_core.errors import DeviceError
from dsl_core.extras import has_package, pip_command
from dsl_core.model.base import Record

BRINGS = f"the window's libraries: {pip_command('gui')}"
_PROGRAM = "dsl_app.rig.projector_process"
_END_S = 5.0
#: A display's refresh rate is told in several ways, 59.94 or 60 Hz; another mode differs by more than this.
_OTHER_RATE = 0.01


class ScreenSettings(Record):
    """Which screen, and how long its light takes."""

    screen: str = Field(
        default="",
        description="name of the screen, such as HDMI-1; the second one if not given",
    )
    platform: str = Field(
        default="",
        description="for a server without a desktop, whose only screen is the projector: linuxfb, eglfs or"
        " offscreen, as Qt names them",
    )
    latency_ms: float = Field(
        default=50.0, ge=0, description="from painted to visible, with a margin; the self-test measures it"
    )
    mode: str = Field(default="", description="the projector's setting, such as 6500 K; recorded in scans")


class ScreenProjector(Projector):
    """Shows patterns through the program that holds the window."""

    def __init__(self, settings: ScreenSettings, command: list[str] | None = None) -> None:
        """Start the program, or another ``command`` that does the same; raises `DeviceError`."""
        self._settings = settings
        command = command or [sys.executable, "-m", _PROGRAM, "--screen", settings.screen]
        variables = dict(os.environ)
        if settings.platform:
            variables["QT_QPA_PLATFORM"] = settings.platform
            command = [*command, "--alone"]
        self._process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=variables
        )
        self.shown_at_s = 0.0
        try:
            said = self._answer()
            self._info = ProjectorInfo(
                str(said["model"]), str(said["serial"]), int(said["width_px"]), int(said["height_px"]),
                settings.latency_ms, float(said["frame_period_ms"]), settings.mode,
            )  # fmt: skip
        except BaseException:
            self.close()
            raise

    @property
    def info(self) -> ProjectorInfo:
        """The screen's name, its size in real pixels, and its period when it last showed a pattern."""
        return self._info

    def show(self, image: NDArray[np.uint8]) -> None:
        """Show drive levels; returns when they are painted and the latency has passed."""
        self._info.require_image(image)
        if self._process.poll() is not None or self._process.stdin is None:
            raise DeviceError(_GONE)
        try:
            self._process.stdin.write((json.dumps(image.shape) + "\n").encode())
            self._process.stdin.write(np.ascontiguousarray(image).tobytes())
            self._process.stdin.flush()
        except OSError as error:
            raise DeviceError(_GONE) from error
        said = self._answer()
        painted_s, period_ms = float(said["painted_s"]), float(said["frame_period_ms"])
        if abs(period_ms - self._info.frame_period_ms) > _OTHER_RATE * self._info.frame_period_ms:
            self._info = replace(self._info, frame_period_ms=period_ms)
        left_s = painted_s + self._settings.latency_ms / 1000.0 - time.monotonic()
        if left_s > 0:
            time.sleep(left_s)
        self.shown_at_s = painted_s

    def close(self) -> None:
        """End the program; its window goes with it."""
        for stream in (self._process.stdin, self._process.stdout):
            if stream is not None:
                # What was not sent yet has nobody to go to, if the program is gone.
                with suppress(OSError):
                    stream.close()
        try:
            self._process.wait(_END_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    def _answer(self) -> dict[str, Any]:
        """The next line of the program; raises `DeviceError` with what it says is wrong."""
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        if not line:
            raise DeviceError(_GONE)
        said: dict[str, Any] = json.loads(line)
        if "error" in said:
            raise DeviceError(str(said["error"]))
        return said


_GONE = (
    "The program that shows patterns has ended. Check that a desktop is running, or give platform in the"
    " profile (linuxfb or eglfs on a server); then open the rig again."
)
DRIVER = Driver(
    "a window on the projector's screen",
    ScreenSettings,
    ScreenProjector,
    # Whoever reads this in the window has its libraries.
    brings="" if has_package("PySide6") else BRINGS,
)
