"""Basler cameras: with pylon against its emulator, and without it a sentence."""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest

from dsl_core.devices.base import Camera
from dsl_core.devices.conformance import CameraConformance
from dsl_core.devices.drivers import basler
from dsl_core.devices.drivers.genicam.camera import GenicamCamera
from dsl_core.devices.drivers.genicam.settings import GenicamSettings
from dsl_core.errors import DeviceError

needs_pylon = pytest.mark.skipif(
    importlib.util.find_spec("pypylon") is None, reason=f"Basler's library is missing: {basler.BRINGS}"
)


@pytest.fixture(autouse=True)
def _emulated(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYLON_CAMEMU", "2")


def open_small(**settings: object) -> GenicamCamera:
    base: dict[str, object] = {"id": "0815-0000", "pixel_format": "Mono16", "region_px": (0, 0, 64, 48)}
    return basler.open_camera(GenicamSettings.model_validate(base | settings))


def test_without_the_library_a_sentence_says_what_brings_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pypylon", None)
    for action in (basler.find_cameras, lambda: basler.open_camera(GenicamSettings())):
        with pytest.raises(DeviceError, match=r'pip install "dsl-scan\[basler\]"'):
            action()


@needs_pylon
class TestBaslerCamera(CameraConformance):
    def open_camera(self) -> Camera:
        return open_small()


@needs_pylon
def test_cameras_are_found_and_told_apart() -> None:
    assert [dict(each.settings)["id"] for each in basler.find_cameras()] == ["0815-0000", "0815-0001"]
    with pytest.raises(DeviceError, match=r"Several Basler cameras .*0815-0000.*0815-0001"):
        open_small(id="")
    with pytest.raises(DeviceError, match="No Basler camera '7' is connected"):
        open_small(id="7")


@pytest.fixture
def pictured(tmp_path: Path) -> Iterator[tuple[GenicamCamera, np.ndarray]]:
    """A camera that delivers one 16-bit picture of ours."""
    picture = np.random.default_rng(3).integers(0, 4096, (48, 64), dtype=np.uint16) << 4
    path = tmp_path / "picture.png"
    cv2.imwrite(str(path), picture)
    features = {"TestImageSelector": "Off", "ImageFileMode": "On", "ImageFilename": str(path)}
    with open_small(features=features, adc_bits=12) as camera:
        yield camera, picture >> 4


@needs_pylon
def test_right_frames_come_and_none_of_fifty_bad_ones(pictured: tuple[GenicamCamera, np.ndarray]) -> None:
    camera, picture = pictured
    camera.configure(1.0)
    port = camera._port
    assert port is not None
    numbers = []
    for _ in range(10):
        port.write("ForceFailedBufferCount", 5)
        port.execute("ForceFailedBuffer")
        frame = camera.snap()
        numbers.append(frame.frame_id)
        np.testing.assert_array_equal(frame.pixels, picture)
    assert (camera.counts.bad, camera.counts.delivered) == (50, 10)
    assert numbers == sorted(set(numbers))
