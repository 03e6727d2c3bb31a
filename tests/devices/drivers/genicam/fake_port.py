"""A GenICam camera in memory, as real ones are: locked features, lost triggers, bad buffers."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from dsl_core.devices.drivers.genicam.port import RawFrame
from dsl_core.errors import DeviceError

NAMED = {
    "ExposureMode": ["Timed", "TriggerWidth"],
    "ExposureAuto": ["Off", "Continuous"],
    "GainAuto": ["Off", "Continuous"],
    "BalanceWhiteAuto": ["Off", "Continuous"],
    "PixelFormat": ["Mono8", "RGB8", "BayerRG8", "BayerRG16", "BayerRG12p"],
    "TriggerMode": ["Off", "On"],
    "TriggerSource": ["Line0", "Software"],
    "TriggerSelector": ["AcquisitionStart", "FrameStart"],
    "AcquisitionMode": ["SingleFrame", "Continuous"],
}
LIMITS = {
    "Width": (16.0, 64.0),
    "Height": (8.0, 48.0),
    "OffsetX": (0.0, 48.0),
    "OffsetY": (0.0, 40.0),
    "BinningHorizontal": (1.0, 2.0),
    "BinningVertical": (1.0, 2.0),
    "ExposureTime": (19.0, 30e6),
    "Gain": (0.0, 24.0),
    "AcquisitionFrameRate": (0.1, 120.0),
}


@dataclass
class FakeSensor:
    """The camera itself, which outlives connections: its features, and what goes wrong with it.

    ``faults`` are taken one a trigger: ``bad``, ``lost`` (the trigger is not noticed), ``""`` for none.
    """

    features: dict[str, float | str] = field(
        default_factory=lambda: {
            **{name: choices[-1] for name, choices in NAMED.items()},
            **{name: high for name, (_, high) in LIMITS.items()},
            "OffsetX": 0.0,
            "OffsetY": 0.0,
            "BinningHorizontal": 1.0,
            "BinningVertical": 1.0,
            "GammaEnabled": 1.0,
            "DeviceTemperature": 41.5,
            "TriggerSoftware": 0.0,
        }
    )
    faults: list[str] = field(default_factory=list)
    wrong_pixels: bool = False
    settles_after: int = 2
    is_gone: bool = False
    is_stale: bool = False
    next_id: int = 65401
    counts_anew: bool = False
    taken: int = 0
    written: list[str] = field(default_factory=list)
    serial: str = "F1"
    busy: int = 0


class FakePort:
    """A connection to the camera."""

    model = "Fake 3"

    def __init__(self, sensor: FakeSensor) -> None:
        if sensor.is_gone:
            raise DeviceError("The camera is not there. Plug it in.")
        self.sensor = sensor
        self.queue: list[RawFrame] = []
        self.running = self.closed = False
        self._unsettled = 0
        sensor.is_stale = False

    @property
    def serial(self) -> str:
        return self.sensor.serial

    def _reach(self) -> FakeSensor:
        if self.sensor.is_gone or self.closed:
            raise DeviceError("The camera does not answer. Check the cable.")
        return self.sensor

    def has(self, feature: str) -> bool:
        return feature in self._reach().features

    def can_write(self, feature: str) -> bool:
        return self.has(feature)

    def choices(self, feature: str) -> list[str]:
        return NAMED[feature]

    def read(self, feature: str) -> float | str:
        sensor = self._reach()
        if self._unsettled and feature.endswith("Auto"):
            self._unsettled -= 1
            return "Continuous"
        return sensor.features[feature]

    def write(self, feature: str, value: float | str) -> None:
        sensor = self._reach()
        if feature not in sensor.features:
            raise DeviceError(f"There is no {feature}.")
        if feature in ("Gain", "ExposureTime"):
            if sensor.features["GainAuto"] != "Off" or self._unsettled:
                return  # as real ones do: locked, without a word
            if feature == "ExposureTime":
                value = min(float(value), 0.95e6 / float(sensor.features["AcquisitionFrameRate"]))
        if feature.endswith("Auto"):
            self._unsettled = sensor.settles_after
        if feature in LIMITS:
            low, high = self.bounds(feature)
            assert low <= float(value) <= high, f"{feature} {value} is out of range"
        sensor.written.append(feature)
        sensor.features[feature] = value

    def bounds(self, feature: str) -> tuple[float, float]:
        low, high = LIMITS[feature]
        if feature in ("Width", "Height"):
            high = high // float(self._reach().features["BinningHorizontal"])
        return low, high

    def execute(self, command: str) -> None:
        sensor = self._reach()
        assert command == "TriggerSoftware"
        if sensor.is_stale:
            raise DeviceError("Another program controls the camera.")
        if not self.running or sensor.busy:
            return
        fault = sensor.faults.pop(0) if sensor.faults else ""
        if fault == "lost":
            return
        sensor.taken += 1
        self.queue.append(self._picture(fault))

    def _picture(self, fault: str) -> RawFrame:
        sensor = self.sensor
        width, height = int(float(sensor.features["Width"])), int(float(sensor.features["Height"]))
        name = str(sensor.features["PixelFormat"])
        pixels = np.full((height, width), 16 * sensor.taken + int(sensor.wrong_pixels), "<u2")
        if name.endswith("12p"):
            pixels = np.zeros((1, -(-width * height * 12 // 16)), "<u2")
        frame_id, sensor.next_id = sensor.next_id, sensor.next_id % 65535 + 1
        return RawFrame(
            pixels.tobytes(), width, height, name, frame_id, "packets are missing" if fault else ""
        )

    def start(self) -> None:
        sensor = self._reach()
        sensor.next_id = 0 if sensor.counts_anew else sensor.next_id
        self.running = True

    def stop(self) -> None:
        self._reach()
        self.running = False
        self.queue.clear()

    def wait_ready(self, timeout_s: float) -> bool:
        sensor = self._reach()
        sensor.busy = max(sensor.busy - 1, 0)
        return not sensor.busy

    def fetch(self, timeout_s: float) -> RawFrame | None:
        self._reach()
        return self.queue.pop(0) if self.queue else None

    def close(self) -> None:
        self.closed = True
