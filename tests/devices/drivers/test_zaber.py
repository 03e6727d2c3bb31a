"""Zaber's driver with a stand-in for the library: units, limits, references and failures."""

from __future__ import annotations

import sys
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest

from dsl_core.devices.base import Stage
from dsl_core.devices.conformance import StageConformance
from dsl_core.devices.drivers.zaber import ZaberSettings, ZaberStage, open_zaber
from dsl_core.errors import DeviceError

UNITS = SimpleNamespace(NATIVE="native", LENGTH_MILLIMETRES="mm")
STEPS_PER_MM = 2000.0


class MotionError(Exception):
    pass


class Axis:
    """A stage of 100 mm that keeps its position in steps; ``fault`` is what goes wrong."""

    def __init__(self, fault: str = "") -> None:
        self.fault, self.steps, self.homed = fault, 20_000.0, fault != "lost"
        self.settings = SimpleNamespace(get=self._get)

    def is_homed(self) -> bool:
        return self.homed

    def home(self) -> None:
        self.steps, self.homed = 0.0, True

    def get_position(self, unit: str) -> float:
        return float("nan") if self.fault == "nan" else self.steps / self._scale(unit)

    def move_absolute(self, position: float, unit: str) -> None:
        if self.fault == "stalls":
            raise MotionError("Movement failed: FS (Stalled and stopped)")
        if self.fault != "stays":
            self.steps = position * self._scale(unit)

    def _get(self, name: str, unit: str) -> float:
        return {"limit.min": 0.0, "limit.max": 200_000.0}[name] / self._scale(unit)

    def _scale(self, unit: str) -> float:
        return 1.0 if unit == "native" else STEPS_PER_MM


class Connection:
    closed = 0

    def __init__(self, axis: Axis) -> None:
        self._axis = axis

    def detect_devices(self, identify_devices: bool) -> list[Any]:
        if self._axis.fault == "silent":
            raise MotionError("Device has not responded in given timeout")
        return [SimpleNamespace(get_axis=lambda number: self._axis)]

    def close(self) -> None:
        self.closed += 1


def stage(fault: str = "", **settings: object) -> ZaberStage:
    axis = Axis(fault)
    chosen = ZaberSettings.model_validate({"port": "COM3", "steps_per_mm": STEPS_PER_MM, **settings})
    return ZaberStage(Connection(axis), axis, chosen, UNITS, MotionError)


class TestZaber(StageConformance):
    def open_stage(self) -> Stage:
        return stage(target_at_zero_mm=600.0)


@pytest.mark.parametrize("steps_per_mm", [0.0, STEPS_PER_MM])
def test_millimetres_are_the_same_in_both_units(steps_per_mm: float) -> None:
    with stage(steps_per_mm=steps_per_mm, target_at_zero_mm=800.0, towards_camera=True) as opened:
        assert opened.range_mm == (700.0, 800.0)
        assert opened.position_mm == pytest.approx(790.0)
        assert opened.move_to(725.0) == pytest.approx(725.0)


@pytest.mark.parametrize(
    ("fault", "told"),
    [("stalls", "could not move to 30 mm .Movement failed"), ("stays", "is at 10 mm"), ("nan", "no number")],
)
def test_a_stage_that_does_not_arrive_is_told(fault: str, told: str) -> None:
    with stage(fault) as opened, pytest.raises(DeviceError, match=told):
        opened.move_to(30.0)


def test_a_lost_reference_and_a_wrong_scale_are_refused() -> None:
    with pytest.raises(DeviceError, match="set home to true"):
        stage("lost")
    assert stage("lost", home=True).position_mm == 0
    with pytest.raises(DeviceError, match="0 to 200000 mm, which no stage"):
        stage(steps_per_mm=1.0)


def test_opening_asks_the_library_and_names_the_package(monkeypatch: pytest.MonkeyPatch) -> None:
    settings = ZaberSettings(port="COM3", steps_per_mm=STEPS_PER_MM)
    monkeypatch.setitem(sys.modules, "zaber_motion", None)
    with pytest.raises(DeviceError, match=r"dsl-scan\[zaber\]"):
        open_zaber(settings)
    library, ascii_part = ModuleType("zaber_motion"), ModuleType("zaber_motion.ascii")
    connection = Connection(Axis())
    library.MotionLibException, library.Units = MotionError, UNITS  # type: ignore[attr-defined]
    ascii_part.Connection = SimpleNamespace(open_serial_port=lambda port: connection)  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "zaber_motion", library)
    monkeypatch.setitem(sys.modules, "zaber_motion.ascii", ascii_part)
    with open_zaber(settings) as opened:
        assert opened.range_mm == (0.0, 100.0)
    with pytest.raises(DeviceError, match="There are 1 devices on 'COM3', not 2"):
        open_zaber(settings.model_copy(update={"device": 2}))
    assert connection.closed == 2
    connection = Connection(Axis("silent"))
    with pytest.raises(DeviceError, match="No stage of Zaber answers"):
        open_zaber(settings)
    assert connection.closed == 1
