"""Cameras by Aravis: found and told apart, errors in sentences; with the library, against its own camera."""

from __future__ import annotations

import ctypes
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest
from filelock import FileLock

from dsl_core.devices.base import Camera
from dsl_core.devices.conformance import CameraConformance
from dsl_core.devices.drivers import aravis, aravis_library
from dsl_core.devices.drivers.genicam.settings import GenicamSettings
from dsl_core.errors import DeviceError
from tests.devices.drivers.aravis_server import AravisServer

try:
    ctypes.CDLL("libaravis-0.8.so.0")
    REASON = ""
except OSError:
    REASON = f"Aravis is not installed: {aravis_library.BRINGS}"
needs_aravis = pytest.mark.skipif(bool(REASON), reason=REASON or "-")
#: The servers of several tests share one port of this computer.
PORT = FileLock(Path(tempfile.gettempdir()) / "dsl-scan-aravis-tests.lock")
SMALL: dict[str, object] = {"pixel_format": "Mono16", "region_px": (0, 0, 64, 48)}


class Listing:
    """A library that knows only which cameras there are."""

    cameras: ClassVar = [("Maker-A-1", "1", "10.0.0.1"), ("Maker-B-2", "2", "10.0.0.2")]

    def __init__(self, count: int) -> None:
        self.count, self.updated = count, False

    def call(self, name: str, *arguments: Any) -> Any:
        if name == "arv_update_device_list":
            self.updated = True
            return None
        assert self.updated, "asked before the list was updated, which opens cameras that deliver nothing"
        if name == "arv_get_n_devices":
            return self.count
        part = {"id": 0, "serial_nbr": 1, "address": 2}[name.removeprefix("arv_get_device_")]
        return self.cameras[arguments[0]][part].encode()


@pytest.mark.parametrize("identifier", ["Maker-B-2", "2", "10.0.0.2"])
def test_a_camera_is_chosen_by_id_serial_number_or_address(identifier: str) -> None:
    assert aravis._choose(Listing(2), identifier) == "Maker-B-2"  # type: ignore[arg-type]
    assert aravis._choose(Listing(1), "") == "Maker-A-1"  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("count", "identifier", "reason"),
    [
        (2, "", "Several cameras are connected: Maker-A-1 .*Say which in the profile"),
        (1, "2", r"No camera '2' is connected; connected: Maker-A-1 \(serial number 1, at 10\.0\.0\.1\)"),
        (0, "", "No camera by USB3 or GigE Vision is connected.*udev"),
    ],
)
def test_what_cannot_be_chosen_is_said_with_what_there_is(count: int, identifier: str, reason: str) -> None:
    with pytest.raises(DeviceError, match=reason):
        aravis._choose(Listing(count), identifier)  # type: ignore[arg-type]


def test_without_the_library_a_sentence_says_what_brings_it() -> None:
    def load(name: str) -> Any:
        raise OSError("not found")

    with pytest.raises(DeviceError, match="apt install"):
        aravis_library.aravis.__wrapped__(load)
    with pytest.raises(DeviceError, match=r"lacks a function .*Install 0\.8\.20"):
        aravis_library.aravis.__wrapped__(lambda name: object())


@pytest.fixture
def served() -> Iterator[list[int]]:
    """A camera whose every picture has the next number in every pixel, 12 bits moved up."""
    painted: list[int] = []

    def paint(height: int, width: int) -> Any:
        painted.append(len(painted) + 1)
        return np.full((height, width), painted[-1] << 4)

    with PORT:
        server = AravisServer("PAINTED", paint)
        yield painted
        server.close()


def open_small(**settings: object) -> Camera:
    return aravis.open_camera(GenicamSettings.model_validate(SMALL | settings))


@needs_aravis
class TestAravisCamera(CameraConformance):
    frame_count = 3  # the test of the wrap below takes more

    @pytest.fixture(autouse=True)
    def _served(self, served: list[int]) -> None:
        pass

    def open_camera(self) -> Camera:
        return open_small(id="PAINTED", adc_bits=12)

    def test_pixels_are_those_of_the_camera(self) -> None:
        with self.open_camera() as camera:
            first, second = (camera.snap().pixels for _ in range(2))
        assert int(second[0, 0]) == int(first[0, 0]) + 1
        assert (first == first[0, 0]).all()

    def test_features_it_lacks_and_values_it_refuses_are_named(self) -> None:
        for features, reason in (({"Nonsense": 1}, "no feature Nonsense"), ({"TriggerSource": "X"}, "X")):
            with pytest.raises(DeviceError, match=reason):
                open_small(features=features)

    @pytest.mark.slow
    def test_frame_numbers_rise_through_the_wrap(self) -> None:
        with self.open_camera() as camera:
            numbers = [camera.snap().frame_id for _ in range(140)]
        assert numbers == list(range(65401, 65541))


@needs_aravis
@pytest.mark.slow
def test_a_camera_that_is_killed_and_started_again_goes_on() -> None:
    command = [sys.executable, str(Path(__file__).with_name("aravis_server.py")), "KILLED"]

    def start() -> subprocess.Popen[bytes]:
        process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        assert process.stdout is not None
        assert process.stdout.readline() == b"ready\n"
        return process

    def end(process: subprocess.Popen[bytes]) -> None:
        process.kill()
        process.communicate()

    with PORT:
        _kill_and_start(start, end)


def _kill_and_start(
    start: Callable[[], subprocess.Popen[bytes]], end: Callable[[subprocess.Popen[bytes]], None]
) -> None:
    server = start()
    with open_small(id="KILLED") as camera:
        camera.configure(10.0)
        before = camera.snap()
        end(server)
        server = start()
        for attempt in range(4):
            try:
                after = camera.snap(1500.0)
                break
            except DeviceError:
                assert attempt < 3
        assert after.frame_id > before.frame_id
        assert after.exposure_ms == before.exposure_ms == 10.0
    end(server)
