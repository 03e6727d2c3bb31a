"""A webcam is read past its stale pictures, put into a mosaic, and called what it is."""

from __future__ import annotations

import platform
import sys
from typing import Any

import numpy as np
import pytest

from dsl_core.devices.base import Camera
from dsl_core.devices.conformance import CameraConformance
from dsl_core.devices.drivers.uvc import (
    CAUTION,
    UvcCamera,
    UvcSettings,
    as_mosaic,
    find_cameras,
    open_camera,
)
from dsl_core.errors import DeviceError, MissingPackageError


class Webcam:
    """Stands for `cv2.VideoCapture`: every picture has the next number as its grey."""

    def __init__(self, opened: bool = True, broken_after: int = 10_000) -> None:
        self.opened, self.broken_after, self.taken = opened, broken_after, 0
        self.properties: dict[int, float] = {}
        self.size = (48, 64)

    def isOpened(self) -> bool:
        return self.opened

    def set(self, prop: int, value: float) -> bool:
        self.properties[prop] = value
        return True

    def read(self) -> tuple[bool, Any]:
        self.taken += 1
        if self.taken > self.broken_after:
            return False, None
        return True, np.full((*self.size, 3), self.taken % 256, np.uint8)

    def release(self) -> None:
        self.opened = False


class TestUvcCamera(CameraConformance):
    def open_camera(self) -> Camera:
        return UvcCamera(UvcSettings(), Webcam())


def test_pictures_from_before_the_call_are_discarded() -> None:
    webcam = Webcam()
    camera = UvcCamera(UvcSettings(stale_frames=3), webcam)
    assert [int(camera.snap().pixels[0, 0]) for _ in range(2)] == [5, 9]


def test_it_warns_of_what_it_is(caplog: pytest.LogCaptureFixture) -> None:
    UvcCamera(UvcSettings(), Webcam())
    assert CAUTION in caplog.text


def test_exposure_is_manual_and_in_its_unit() -> None:
    webcam = Webcam()
    UvcCamera(UvcSettings(), webcam).configure(20.0)
    assert (webcam.properties[21], webcam.properties[44], webcam.properties[15]) == (1, 0, 200.0)


def test_each_pixel_keeps_the_colour_of_its_site() -> None:
    picture = np.zeros((4, 4, 3), np.uint8)
    picture[...] = (10, 20, 30)
    assert as_mosaic(picture)[:2, :2].tolist() == [[30, 20], [20, 10]]


def test_a_webcam_that_is_not_there_or_breaks_off_is_named() -> None:
    with pytest.raises(DeviceError, match="Webcam 0 cannot be opened"):
        UvcCamera(UvcSettings(), Webcam(opened=False))
    camera = UvcCamera(UvcSettings(), Webcam(broken_after=3))
    with pytest.raises(DeviceError, match="no picture in time"):
        camera.snap()
    webcam = Webcam()
    camera = UvcCamera(UvcSettings(), webcam)
    webcam.size = (24, 32)
    with pytest.raises(DeviceError, match="changed its picture to 32 x 24"):
        camera.snap()


def test_without_opencv_a_sentence_says_what_brings_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delitem(sys.modules, "cv2", raising=False)
    monkeypatch.setattr("dsl_core.extras.find_spec", lambda name: None)
    with pytest.raises(MissingPackageError, match=r'package cv2.*pip install "dsl-scan\[reconstruct\]"'):
        open_camera(UvcSettings())


@pytest.mark.parametrize("system", ["Windows", "Darwin"])
def test_that_webcams_are_not_looked_for_is_said(monkeypatch: pytest.MonkeyPatch, system: str) -> None:
    monkeypatch.setattr(platform, "system", lambda: system)
    with pytest.raises(DeviceError, match="State index in the profile"):
        find_cameras()
