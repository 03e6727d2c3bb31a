"""Webcams by OpenCV, to try the program with: their pictures are not measurements."""

from __future__ import annotations

import logging
import math
import platform
import time
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from dsl_core.devices.base import Camera, CameraInfo
from dsl_core.devices.driver_table import Driver, FoundDevice
from dsl_core.errors import DeviceError
from dsl_core.extras import pip_command, require_package
from dsl_core.model.base import Record
from dsl_core.model.frames import Frame

_log = logging.getLogger(__name__)
CAUTION = (
    "A webcam changes its pictures by gamma, compression, noise reduction and often automatic exposure, in 8"
    " bits. Use it to try the program; depth will be rough, and spectra from it mean nothing."
)
BRINGS = f"{pip_command('reconstruct')} (OpenCV)"
#: Positions of `cv2.CAP_PROP_...`, which are the same in all versions.
_WIDTH, _HEIGHT, _EXPOSURE, _AUTO_EXPOSURE, _AUTO_WHITE = 3, 4, 15, 21, 44
#: What Linux's driver takes for manual exposure, and its unit of exposure.
_MANUAL, _UNIT_MS = 1, 0.1
_MOST_DEVICES = 8


class UvcSettings(Record):
    """Which webcam, and its picture size."""

    index: int = Field(default=0, ge=0, description="number of the webcam, from 0")
    size_px: tuple[int, int] = Field(default=(640, 480), description="width and height of its pictures")
    exposure_range_ms: tuple[float, float] = Field(
        default=(0.1, 500.0), description="shortest and longest exposure; webcams do not say theirs"
    )
    stale_frames: int = Field(
        default=4, ge=1, description="frames to discard before each one: how many the webcam keeps in store"
    )


class UvcCamera(Camera):
    """A webcam whose colours are put back into a mosaic, as if they had been measured by one."""

    def __init__(self, settings: UvcSettings, capture: Any) -> None:
        """Set up ``capture``, a `cv2.VideoCapture`; raises `DeviceError` when it cannot be read."""
        self._settings, self._capture = settings, capture
        if not capture.isOpened():
            raise DeviceError(
                f"Webcam {settings.index} cannot be opened. Check that it is plugged in, that no other"
                " program uses it, and that index in the profile is its number."
            )
        _log.warning("%s", CAUTION)
        for prop, value in zip((_WIDTH, _HEIGHT), settings.size_px, strict=True):
            capture.set(prop, value)
        capture.set(_AUTO_EXPOSURE, _MANUAL)
        capture.set(_AUTO_WHITE, 0)
        self._exposure_ms, self._taken = settings.exposure_range_ms[0], 0
        height, width = self._read(time.monotonic() + 5.0).shape[:2]
        self._info = CameraInfo(
            f"webcam {settings.index}", "", width, height, "RGGB", 8, settings.exposure_range_ms
        )

    @property
    def info(self) -> CameraInfo:
        """What the webcam delivers."""
        return self._info

    def configure(self, exposure_ms: float) -> float:
        """Set the exposure; what the webcam does with it, it does not say."""
        low, high = self._info.exposure_range_ms
        if not (math.isfinite(exposure_ms) and low <= exposure_ms <= high):
            raise DeviceError(
                f"The webcam is used from {low:g} to {high:g} ms, not {exposure_ms:g} ms. Change the plan's"
                " settings, or exposure_range_ms in the profile."
            )
        if not self._capture.set(_EXPOSURE, exposure_ms / _UNIT_MS):
            _log.warning("the webcam keeps its own exposure, so brackets and merging are wrong")
        self._exposure_ms = exposure_ms
        return exposure_ms

    def snap(self, timeout_ms: float = 5000.0) -> Frame:
        """Discard what was exposed before the call, and return the next picture as a mosaic."""
        until_s = time.monotonic() + timeout_ms / 1000.0
        for _ in range(self._settings.stale_frames):
            self._read(until_s)
        picture = self._read(until_s)
        self._taken += 1
        if picture.shape[:2] != (self._info.height_px, self._info.width_px):
            raise DeviceError(
                f"The webcam changed its picture to {picture.shape[1]} x {picture.shape[0]} pixels."
                " Restart it."
            )
        return Frame(as_mosaic(picture), self._exposure_ms, time.monotonic(), self._taken)

    def close(self) -> None:
        """Release the webcam."""
        self._capture.release()

    def _read(self, until_s: float) -> NDArray[np.uint8]:
        good, picture = self._capture.read()
        if not good or picture is None or time.monotonic() > until_s:
            raise DeviceError("The webcam delivered no picture in time. Check its cable, and try again.")
        return np.asarray(picture, np.uint8)


def as_mosaic(picture: NDArray[np.uint8]) -> NDArray[np.uint16]:
    """The pixels that an RGGB mosaic would have of a picture (rows, columns, 3), blue first."""
    mosaic = picture[..., 1].astype(np.uint16)
    mosaic[::2, ::2] = picture[::2, ::2, 2]
    mosaic[1::2, 1::2] = picture[1::2, 1::2, 0]
    return mosaic


def find_cameras() -> list[FoundDevice]:
    """Webcams that Linux lists; raises `DeviceError` on other systems."""
    if platform.system() != "Linux":
        raise DeviceError(
            "Webcams are looked for on Linux alone. State index in the profile: 0 for the first, then 1."
        )
    devices = [n for n in range(_MOST_DEVICES) if Path(f"/dev/video{n}").exists()]
    return [FoundDevice({"index": n}, f"webcam {n} (/dev/video{n})") for n in devices]


def open_camera(settings: UvcSettings) -> UvcCamera:
    """Open a webcam; raises `DeviceError`, and `MissingPackageError` without OpenCV."""
    require_package("cv2")
    import cv2

    # OpenCV writes lines of its own to the terminal about each way in which it could not open a webcam.
    level = cv2.utils.logging.getLogLevel()
    cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_ERROR)
    try:
        capture = cv2.VideoCapture(settings.index)
    finally:
        cv2.utils.logging.setLogLevel(level)
    return UvcCamera(settings, capture)


DRIVER = Driver(f"webcams, for trials only. {CAUTION}", UvcSettings, open_camera, find_cameras, BRINGS)
