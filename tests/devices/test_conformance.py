"""The conformance suites find the mistakes that drivers make."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from dsl_core.devices.base import (
    Camera,
    CameraInfo,
    DeviceRig,
    Projector,
    ProjectorInfo,
    Spectroradiometer,
    Stage,
)
from dsl_core.devices.conformance import (
    CameraConformance,
    ProjectorConformance,
    RigConformance,
    SpectroradiometerConformance,
    StageConformance,
)
from dsl_core.errors import DeviceError
from dsl_core.model.frames import Frame
from dsl_core.model.placement import Placement
from dsl_core.model.rig import Rig
from dsl_core.model.spectral import SpectralCurve
from tests.cases.small_rig import small_rig


class Light:
    """The last pattern shown, and the one before."""

    def __init__(self) -> None:
        self.now = self.before = np.zeros((6, 10), np.uint8)


class GoodCamera(Camera):
    """Right in everything but the named fault."""

    def __init__(self, fault: str = "", light: Light | None = None) -> None:
        self.fault = fault
        self.light = light or Light()
        self.exposure_ms, self.count, self.closed = 5.0, 0, False
        self.buffer = np.zeros((4, 6), np.uint16)

    @property
    def info(self) -> CameraInfo:
        changed = self.fault == "changes" and self.count > 0
        high = 0.5 if self.fault == "range" else 50.0
        return CameraInfo("good", "1", 6, 4, "RGGB", 10 if changed else 12, (1.0, high))

    def configure(self, exposure_ms: float) -> float:
        if not 1.0 <= exposure_ms <= 50.0 and self.fault != "lenient":
            raise DeviceError(f"{exposure_ms} ms is outside 1 to 50 ms; choose another exposure.")
        self.exposure_ms = exposure_ms
        return 2 * exposure_ms if self.fault == "rounds" else exposure_ms

    def snap(self, timeout_ms: float = 5000.0) -> Frame:
        self.count += 1
        if self.fault == "loses" and self.count % 5 in (0, 1):
            raise DeviceError("The frame did not arrive; ask for the next one.")
        image = self.light.before if self.fault == "early" else self.light.now
        pixels = self.buffer if self.fault == "buffer" else np.zeros((4, 6), np.uint16)
        pixels[:] = self.count + int(10 * image.mean())
        if self.fault == "left":
            pixels <<= 12
        if self.fault == "upper":
            pixels <<= 4
        if self.fault == "shape":
            pixels = pixels.T
        if self.fault == "type":
            pixels = pixels.astype(np.uint8)
        number = {"count": 1, "wraps": self.count % 128}.get(self.fault, self.count)
        time_s = -float(self.count) if self.fault == "clock" else float(self.count)
        return Frame(pixels, 3.0 if self.fault == "says" else self.exposure_ms, time_s, number)

    def close(self) -> None:
        if self.fault == "close" and self.closed:
            raise DeviceError("closed already")
        self.closed = True


class GoodProjector(Projector):
    def __init__(self, fault: str = "", light: Light | None = None) -> None:
        self.fault = fault
        self.light = light or Light()

    @property
    def info(self) -> ProjectorInfo:
        return ProjectorInfo("good", "2", 10, 6, -1.0 if self.fault == "latency" else 0.0, 16.0)

    def show(self, image: NDArray[np.uint8]) -> None:
        wrong = image.dtype != np.uint8 or image.shape not in ((6, 10), (6, 10, 3))
        if wrong and self.fault != "lenient":
            raise DeviceError("no" if self.fault == "terse" else "wanted 6 x 10 pixels; make the pattern so")
        if self.fault == "grey" and image.ndim == 3:
            raise DeviceError("This projector shows grey only.")
        self.light.before, self.light.now = self.light.now, image


class GoodStage(Stage):
    def __init__(self, fault: str = "") -> None:
        self.fault = fault
        self.at_mm = 5.0

    @property
    def range_mm(self) -> tuple[float, float]:
        return (0.0, 10.0)

    @property
    def position_mm(self) -> float:
        return self.at_mm

    def move_to(self, position_mm: float) -> float:
        if self.fault == "creeps":
            self.at_mm = min(max(position_mm, 0.0), 10.0)
        if not 0 <= position_mm <= 10 and self.fault != "lenient":
            raise DeviceError("outside 0 to 10 mm; choose a position inside")
        self.at_mm = position_mm + (0.5 if self.fault == "misses" else 0.0)
        return position_mm


class GoodMeter(Spectroradiometer):
    def __init__(self, fault: str = "") -> None:
        self.fault = fault

    def measure(self) -> SpectralCurve:
        low = 500.0 if self.fault == "narrow" else 380.0
        unit = "1" if self.fault == "unit" else "W/(sr m2 nm)"
        return SpectralCurve(wavelengths_nm=(low, 780.0), values=(1.0, 2.0), unit=unit)


class Hand:
    """Places what it is asked to, but for the named fault."""

    def __init__(self, fault: str) -> None:
        self.fault, self.now = fault, "a mug"

    def place(self, placement: Placement) -> None:
        if placement.target == "nothing" or self.fault == "lazy":
            raise DeviceError("This hand can only hold things; put them away yourself.")
        self.now = "" if self.fault == "mute" else placement.target

    def put_back(self) -> None:
        self.now = "a mug" if self.fault != "forgets" else "another mug"

    def standing(self) -> str:
        return self.now


def _nominal(fault: str) -> Rig:
    known = small_rig()
    wide = 64 if fault == "other shape" else 6
    changes: dict[str, object] = {
        "camera": known.camera.resized(wide, 4),
        "projector": known.projector.resized(10, 6),
    }
    if fault == "second order":
        changes["efficiency"] = {2: known.efficiency[1]}
    if fault == "10 bits":
        changes["sensor"] = known.sensor.model_copy(update={"bit_depth": 10})
    if fault == "metres":
        changes["film"] = known.film.model_copy(update={"lines_per_mm": 0.48})
    if fault == "no light":
        changes["emission"] = (SpectralCurve.of([400, 420], [1.0, 0.0]), *known.emission[1:])
    return known.model_copy(update=changes)


class Everything(
    CameraConformance, ProjectorConformance, StageConformance, SpectroradiometerConformance, RigConformance
):
    def __init__(self, device: str = "", fault: str = "") -> None:
        self.faults = {device: fault}

    def open_camera(self) -> Camera:
        return GoodCamera(self.faults.get("camera", ""))

    def open_projector(self) -> Projector:
        return GoodProjector(self.faults.get("projector", ""))

    def open_stage(self) -> Stage:
        return GoodStage(self.faults.get("stage", ""))

    def open_spectroradiometer(self) -> Spectroradiometer:
        return GoodMeter(self.faults.get("meter", ""))

    def open_rig(self) -> DeviceRig:
        light, fault, hand = Light(), self.faults.get("rig", ""), Hand(self.faults.get("rig", ""))
        camera = GoodCamera(fault, light)
        return DeviceRig(
            "good",
            camera,
            GoodProjector("", light),
            nominal=_nominal(fault),
            place=hand.place,
            put_back=None if fault == "keeps" else hand.put_back,
            standing=hand.standing,
            filters={550.0: SpectralCurve.of([530, 550, 570], [0, 90 if fault == "percent" else 0.9, 0])},
        )


def _failing(suite: Everything) -> list[str]:
    failing = []
    for name in sorted(n for n in dir(suite) if n.startswith("test_")):
        try:
            getattr(suite, name)()
        except (AssertionError, DeviceError):
            failing.append(name)
    return failing


def test_a_good_rig_passes() -> None:
    assert _failing(Everything()) == []


def test_frames_that_are_lost_are_asked_for_again() -> None:
    assert _failing(Everything("camera", "loses")) == []


@pytest.mark.parametrize(
    ("device", "fault", "test"),
    [
        ("camera", "range", "test_camera_info_is_plausible_and_constant"),
        ("camera", "changes", "test_camera_info_is_plausible_and_constant"),
        ("camera", "rounds", "test_camera_returns_the_exposure_in_force"),
        ("camera", "says", "test_camera_returns_the_exposure_in_force"),
        ("camera", "lenient", "test_camera_refuses_exposures_out_of_range"),
        ("camera", "left", "test_camera_delivers_the_raw_mosaic"),
        ("camera", "upper", "test_camera_delivers_the_raw_mosaic"),
        ("camera", "shape", "test_camera_delivers_the_raw_mosaic"),
        ("camera", "type", "test_camera_delivers_the_raw_mosaic"),
        ("camera", "count", "test_camera_counts_frames"),
        ("camera", "wraps", "test_camera_counts_frames"),
        ("camera", "clock", "test_camera_counts_frames"),
        ("camera", "buffer", "test_camera_frames_stay_as_they_are"),
        ("camera", "close", "test_camera_closes_twice"),
        ("projector", "latency", "test_projector_info_is_plausible"),
        ("projector", "lenient", "test_projector_refuses_other_images"),
        ("projector", "terse", "test_projector_refuses_other_images"),
        ("projector", "grey", "test_projector_shows_grey_and_colour"),
        ("stage", "misses", "test_stage_arrives"),
        ("stage", "lenient", "test_stage_refuses_positions_out_of_range"),
        ("stage", "creeps", "test_stage_refuses_positions_out_of_range"),
        ("meter", "unit", "test_spectroradiometer_measures_radiance"),
        ("meter", "narrow", "test_spectroradiometer_measures_radiance"),
        ("rig", "early", "test_rig_camera_sees_what_the_projector_shows"),
        ("rig", "other shape", "test_rig_nominal_describes_its_devices"),
        ("rig", "second order", "test_rig_nominal_describes_its_devices"),
        ("rig", "metres", "test_rig_nominal_describes_its_devices"),
        ("rig", "10 bits", "test_rig_nominal_describes_its_devices"),
        ("rig", "no light", "test_rig_nominal_describes_its_devices"),
        ("rig", "percent", "test_rig_filters_are_transmissions"),
        ("rig", "keeps", "test_rig_places_targets_and_puts_them_back"),
        ("rig", "forgets", "test_rig_places_targets_and_puts_them_back"),
        ("rig", "lazy", "test_rig_places_targets_and_puts_them_back"),
        ("rig", "mute", "test_rig_places_targets_and_puts_them_back"),
    ],
)
def test_each_mistake_is_found(device: str, fault: str, test: str) -> None:
    assert test in _failing(Everything(device, fault))
