"""A profile opens its devices, and closes those it has when one fails."""

from __future__ import annotations

from importlib.metadata import EntryPoint

import pytest

from dsl_core.devices import driver_table
from dsl_core.devices.base import Camera, CameraInfo
from dsl_core.devices.driver_table import Driver
from dsl_core.devices.profile import DevicePart, RigProfile, open_parts
from dsl_core.errors import DeviceError
from dsl_core.model.base import Record
from dsl_core.model.frames import Frame

closed: list[str] = []


class NameSettings(Record):
    name: str = "eye"


class NamedCamera(Camera):
    info = CameraInfo("named", "1", 4, 4, "RGGB", 12, (1.0, 2.0))

    def __init__(self, settings: NameSettings) -> None:
        self.name = settings.name

    def configure(self, exposure_ms: float) -> float:
        return exposure_ms

    def snap(self, timeout_ms: float = 5000.0) -> Frame:
        raise DeviceError("It has no sensor. Use another one.")

    def close(self) -> None:
        closed.append(self.name)


DRIVER = Driver("a camera with a name", NameSettings, NamedCamera)


@pytest.fixture(autouse=True)
def _named_camera(monkeypatch: pytest.MonkeyPatch) -> None:
    line = EntryPoint("camera.named", f"{__name__}:DRIVER", "x")
    monkeypatch.setattr(driver_table, "BUILT_IN", (*driver_table.BUILT_IN, line))
    closed.clear()


CAMERA = DevicePart(driver="named", settings={"name": "left"})
PROJECTOR = DevicePart(driver="none", settings={"size_px": [64, 48]})


def test_a_profile_opens_its_devices() -> None:
    profile = RigProfile(name="lab", camera=CAMERA, projector=PROJECTOR)
    assert list(profile.parts()) == ["camera", "projector"]
    with open_parts(profile) as rig:
        assert (rig.name, rig.camera.info.model, rig.projector.info.width_px) == ("lab", "named", 64)
        assert rig.stage is None
    assert closed == ["left"]


def test_a_device_that_fails_closes_those_before_it() -> None:
    profile = RigProfile(name="lab", camera=CAMERA, projector=PROJECTOR, stage=DevicePart(driver="absent"))
    with pytest.raises(DeviceError, match="no driver 'absent'"):
        open_parts(profile)
    assert closed == ["left"]
