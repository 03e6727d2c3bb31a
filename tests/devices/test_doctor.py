"""Each device of a broken set-up is tried, and each failure says what it is and what to do."""

from __future__ import annotations

from collections.abc import Callable
from importlib.metadata import EntryPoint
from typing import TypeVar

import numpy as np
import pytest
from numpy.typing import NDArray
from pydantic import Field

from dsl_core.devices import doctor, driver_table
from dsl_core.devices.base import Camera, CameraInfo, Projector, ProjectorInfo, Spectroradiometer, Stage
from dsl_core.devices.device_thread import DeviceThread, HangingError
from dsl_core.devices.doctor import Grade, examine, survey
from dsl_core.devices.driver_table import Driver, FoundDevice
from dsl_core.devices.profile import DevicePart, RigProfile
from dsl_core.errors import DeviceError
from dsl_core.model.base import Record
from dsl_core.model.frames import Frame
from dsl_core.model.spectral import SpectralCurve
from tests.cases.small_rig import small_rig

T = TypeVar("T")


class Trouble(Record):
    trouble: str = Field(default="", description="what goes wrong")


class TryCamera(Camera):
    """Sees the level that the last projector shows."""

    level = 0
    info = CameraInfo("eye", "7", 8, 6, "RGGB", 16, (1.0, 100.0))
    temperature_c = 40.0

    def __init__(self, settings: Trouble) -> None:
        self.trouble, self.count = settings.trouble, 0
        if self.trouble == "absent":
            raise DeviceError("No camera is connected. Check its cable.")

    def configure(self, exposure_ms: float) -> float:
        self.exposure_ms = exposure_ms
        return exposure_ms

    def snap(self, timeout_ms: float = 5000.0) -> Frame:
        if self.trouble == "crashes":
            raise ValueError("driver state 17")
        self.count += self.trouble != "stuck"
        low = 1 if self.trouble != "left" else 0
        level = TryCamera.level if self.trouble != "capped" else 0
        pixels = ((level + 1 + np.arange(48)) * 64 + low).astype(np.uint16).reshape(6, 8)
        return Frame(pixels, self.exposure_ms, float(self.count), self.count)


class TryProjector(Projector):
    info = ProjectorInfo("lamp", "8", 4, 3, 0.0, 10.0)

    def __init__(self, settings: Trouble) -> None:
        pass

    def show(self, image: NDArray[np.uint8]) -> None:
        TryCamera.level = int(image.max())


class TryStage(Stage):
    range_mm = (0.0, 150.0)
    position_mm = 12.0

    def __init__(self, settings: Trouble) -> None:
        pass

    def move_to(self, position_mm: float) -> float:
        raise AssertionError("the doctor moves nothing")


class TryInstrument(Spectroradiometer):
    def __init__(self, settings: Trouble) -> None:
        self.trouble = settings.trouble

    def measure(self) -> SpectralCurve:
        last = 800.0 if not self.trouble else 500.0
        nm = np.linspace(380.0, last, 101)
        return SpectralCurve.of(nm, 1.0 + 0.1 * np.sin(nm), unit="W/(sr m2 nm)")


def _find() -> list[FoundDevice]:
    return [FoundDevice({"trouble": ""}, "eye 7 on port 3")]


def _cannot_find() -> list[FoundDevice]:
    raise DeviceError("The library is missing. Install it.")


CAMERA = Driver("an eye", Trouble, TryCamera, _find)
SEEN = Driver("an eye", Trouble, TryCamera, lambda: [FoundDevice({"id": "P3"}, "eye on port 3")])


def _busy() -> list[FoundDevice]:
    raise OSError(16, "Device or resource busy")


class MuteCamera(TryCamera):
    """Opens and does not say what it is."""

    closed = 0

    @property
    def info(self) -> CameraInfo:  # type: ignore[override]
        raise RuntimeError("no descriptor")

    def close(self) -> None:
        MuteCamera.closed += 1


BUSY = Driver("an eye", Trouble, TryCamera, _busy)
MUTE = Driver("an eye", Trouble, MuteCamera)
PROJECTOR = Driver("a lamp", Trouble, TryProjector, brings="a lamp's library")
STAGE = Driver("a stage", Trouble, TryStage, lambda: [])
INSTRUMENT = Driver("an instrument", Trouble, TryInstrument, _cannot_find)


@pytest.fixture(autouse=True)
def _drivers(monkeypatch: pytest.MonkeyPatch) -> None:
    values = {
        "camera.try": "CAMERA",
        "camera.seen": "SEEN",
        "camera.busy": "BUSY",
        "camera.mute": "MUTE",
        "projector.try": "PROJECTOR",
        "stage.try": "STAGE",
        "spectroradiometer.try": "INSTRUMENT",
    }
    monkeypatch.setattr(TryCamera, "level", 0)
    lines = [EntryPoint(name, f"{__name__}:{value}", "x") for name, value in values.items()]
    monkeypatch.setattr(driver_table, "BUILT_IN", lines)


def profile(camera: str = "", instrument: str = "", **changes: object) -> RigProfile:
    parts: dict[str, object] = {
        "camera": DevicePart(driver="try", settings={"trouble": camera}),
        "projector": DevicePart(driver="try"),
        "stage": DevicePart(driver="try"),
        "spectroradiometer": DevicePart(driver="try", settings={"trouble": instrument}),
    }
    return RigProfile.model_validate({"name": "lab"} | parts | changes)


def _with_camera(driver: str, trouble: str = "") -> RigProfile:
    part = DevicePart(driver=driver, settings={"trouble": trouble})
    return profile().model_copy(update={"camera": part})


def grades(found: list[doctor.Finding]) -> dict[str, str]:
    """The worst grade of each device."""
    order = [Grade.GOOD, Grade.WARNING, Grade.BAD]
    names = {finding.device for finding in found}
    return {n: str(max((f.grade for f in found if f.device == n), key=order.index)) for n in names}


def test_a_sound_rig_is_described_and_nothing_is_moved() -> None:
    found = examine(profile())
    assert set(grades(found).values()) == {"good"}
    text = " ".join(finding.text for finding in found)
    for words in (
        "eye 7: 8 x 6 px",
        "40.0 °C",
        "lamp 8: 4 x 3 px",
        "at 12 mm of 0 to 150 mm",
        "380 to 800 nm",
    ):
        assert words in text


@pytest.mark.parametrize(("bits", "is_told"), [(16, False), (12, True)])
def test_data_sheets_of_another_bit_depth_are_told(bits: int, is_told: bool) -> None:
    nominal = small_rig()
    sensor = nominal.sensor.model_copy(update={"bayer": "RGGB", "bit_depth": bits})
    found = examine(profile(), nominal.model_copy(update={"sensor": sensor}))
    told = [each.text for each in found if each.device == "data sheets"]
    assert bool(told) is is_told
    assert all("RGGB of 12 bits, the camera RGGB of 16 bits" in each for each in told)


@pytest.mark.parametrize(
    ("camera", "grade", "words"),
    [
        ("absent", "bad", "Check its cable. The driver sees: eye 7 on port 3."),
        ("crashes", "bad", "ValueError: driver state 17"),
        ("stuck", "bad", "which must rise"),
        ("left", "warning", "lowest 6 of 16 bits are always 0"),
    ],
)
def test_a_broken_camera_is_told_and_the_others_still_tried(camera: str, grade: str, words: str) -> None:
    found = examine(profile(camera))
    worst = grades(found)
    assert worst["camera try"] == grade
    assert (worst["projector try"], worst["stage try"]) == ("good", "good")
    assert any(words in finding.text for finding in found), found


def test_a_device_that_never_answers_is_given_up(monkeypatch: pytest.MonkeyPatch) -> None:
    class Impatient(DeviceThread):
        def call(self, device: str, action: Callable[[], T], patience_s: float) -> T:
            if device == "camera try":
                raise HangingError(patience_s)
            return super().call(device, action, patience_s)

    monkeypatch.setattr(doctor, "DeviceThread", Impatient)
    found = examine(profile())
    assert grades(found)["stage try"] == "good"
    assert found[0].text.startswith("It has not answered for 60 s. Switch it off and on")


def test_a_camera_that_does_not_see_the_light_is_told() -> None:
    found = examine(profile("capped"))
    assert grades(found)["camera and projector"] == "warning"
    assert any("Take off lens caps" in finding.text for finding in found)


def test_a_driver_that_cannot_even_look_or_say_what_it_opened_hides_no_other_device() -> None:
    found = examine(_with_camera("busy", "absent"))
    assert grades(found)["camera busy"] == "bad"
    assert grades(found)["spectroradiometer try"] == "good"
    found = examine(_with_camera("mute"))
    assert grades(found)["camera mute"] == "bad"
    assert grades(found)["spectroradiometer try"] == "good"
    assert MuteCamera.closed == 1
    assert "Its driver failed (OSError" in {each.device: each for each in survey()}["camera busy"].text


def test_all_failures_are_gathered() -> None:
    found = examine(
        profile(
            "absent", "short", stage={"driver": "missing"}, projector={"driver": "try", "settings": {"x": 1}}
        )
    )
    assert grades(found) == {
        "camera try": "bad",
        "projector try": "bad",
        "stage missing": "bad",
        "spectroradiometer try": "warning",
    }


def test_without_a_profile_drivers_say_what_they_see_or_lack() -> None:
    found = {finding.device: finding for finding in survey()}
    assert found["camera try"].text == "eye 7 on port 3; settings {'trouble': ''}"
    assert found["stage try"].grade is Grade.WARNING
    assert "Install it" in found["spectroradiometer try"].text
    assert found["projector try"].text.endswith("state its settings in a profile. It needs a lamp's library.")


def test_devices_on_one_port_are_told() -> None:
    both = {"driver": "try", "settings": {"port": "COM4"}}
    found = examine(profile(stage=both, spectroradiometer=both))
    assert found[0].device == "stage and spectroradiometer"
    assert found[0].text.startswith("Both name the port COM4")
    alone = examine(profile(stage=both))
    assert not any("Both name" in each.text for each in alone)


def test_what_the_driver_sees_is_said_once_and_only_of_devices_that_cannot_be_opened() -> None:
    wrong, thread = DevicePart(driver="seen", settings={"x": 1}), DeviceThread("try")
    assert doctor._seen_instead("camera", wrong, thread, "x is not a field of it.") == ""
    part = DevicePart(driver="seen")
    assert doctor._seen_instead("camera", part, thread, "No camera.") == "The driver sees: eye on port 3."
    assert doctor._seen_instead("camera", part, thread, "No camera; there is P3.") == ""
