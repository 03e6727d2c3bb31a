"""Zaber's stages by their own library, zaber-motion (MIT), imported when one is opened."""

from __future__ import annotations

import math
from typing import Any

from pydantic import Field

from dsl_core.devices.base import Stage
from dsl_core.devices.driver_table import Driver
from dsl_core.devices.drivers.rail import RailSettings
from dsl_core.errors import DeviceError
from dsl_core.extras import pip_command

BRINGS = f"{pip_command('zaber')} (zaber-motion)"


class ZaberSettings(RailSettings):
    """Which stage, and what it may do."""

    port: str = Field(min_length=1, description="serial port, such as /dev/ttyUSB0 or COM4")
    device: int = Field(default=1, ge=1, description="which device on the port's chain, from 1")
    axis: int = Field(default=1, ge=1, description="which axis of the device, from 1")
    steps_per_mm: float = Field(
        default=0.0,
        ge=0,
        description="microsteps a millimetre; 0: as the library finds on the internet, once",
    )
    home: bool = Field(
        default=False,
        description="let it find its reference when it has not; it moves to its end, so clear its way first",
    )
    tolerance_mm: float = Field(default=0.01, gt=0, description="how exactly it has to arrive, mm")


class ZaberStage(Stage):
    """An axis on an open connection; ``units`` are the library's, ``failure`` is the base of its errors."""

    def __init__(
        self, connection: Any, axis: Any, settings: ZaberSettings, units: Any, failure: type[Exception]
    ) -> None:
        """Read the limits, and let it find its reference if that is asked for; raises `DeviceError`."""
        self._connection, self._axis, self._settings = connection, axis, settings
        self._failure, self._is_open = failure, True
        self._per_mm = settings.steps_per_mm or 1.0
        self._unit = units.NATIVE if settings.steps_per_mm else units.LENGTH_MILLIMETRES
        self._name = f"The stage on {settings.port}"
        if not self._do("say whether it has its reference", lambda: axis.is_homed()):
            if not settings.home:
                raise DeviceError(
                    f"{self._name} has not found its reference since it was switched on, so its positions"
                    " mean nothing. Clear its way, as it moves to its end, and set home to true."
                )
            self._do("find its reference", lambda: axis.home())
        limits = [self._setting("limit.min"), self._setting("limit.max")]
        if not limits[0] < limits[1] <= limits[0] + 5000:
            raise DeviceError(
                f"{self._name} says that it moves from {limits[0]:g} to {limits[1]:g} mm, which no stage of"
                " this kind does. Correct steps_per_mm."
            )
        low, high = sorted(settings.to_target(mm) for mm in limits)
        self._range_mm = low, high

    @property
    def range_mm(self) -> tuple[float, float]:
        """Smallest and largest position of the target, mm."""
        return self._range_mm

    @property
    def position_mm(self) -> float:
        """Where the target is, mm."""
        steps = self._do("say where it is", lambda: self._axis.get_position(self._unit))
        return self._settings.to_target(float(steps) / self._per_mm)

    def move_to(self, position_mm: float) -> float:
        """Move, wait until it stands still, and return the position read back, mm."""
        low, high = self._range_mm
        if not low <= position_mm <= high:
            raise DeviceError(
                f"{self._name} moves from {low:g} to {high:g} mm, not to {position_mm:g} mm. Choose a"
                " position in its range."
            )
        there = self._settings.to_stage(position_mm) * self._per_mm
        there = round(there) if self._settings.steps_per_mm else there
        self._do(f"move to {position_mm:g} mm", lambda: self._axis.move_absolute(there, self._unit))
        reached_mm = self.position_mm
        if not abs(reached_mm - position_mm) <= self._settings.tolerance_mm:
            raise DeviceError(
                f"{self._name} was to move to {position_mm:g} mm and is at {reached_mm:g} mm. Check that"
                " nothing blocks it, and let it find its reference again."
            )
        return reached_mm

    def close(self) -> None:
        """Release the port; a second call does nothing."""
        if self._is_open:
            self._is_open = False
            try:
                self._connection.close()
            except self._failure:
                return  # the port is gone, which closing wants

    def _setting(self, name: str) -> float:
        value = self._do(f"state its {name}", lambda: self._axis.settings.get(name, self._unit))
        return float(value) / self._per_mm

    def _do(self, what: str, action: Any) -> Any:
        if not self._is_open:
            raise DeviceError(f"{self._name} is closed. Open the rig again.")
        try:
            answer = action()
        except self._failure as error:
            raise DeviceError(
                f"{self._name} could not {what} ({' '.join(str(error).split())[:200]}). Check its cable and"
                " power, and that nothing blocks it."
            ) from error
        if isinstance(answer, float) and not math.isfinite(answer):
            raise DeviceError(f"{self._name} answered with no number when asked to {what}. Open it again.")
        return answer


def open_zaber(settings: ZaberSettings) -> ZaberStage:
    """Open an axis on a serial port; raises `DeviceError`."""
    try:
        from zaber_motion import MotionLibException, Units
        from zaber_motion.ascii import Connection
    except ImportError as error:
        raise DeviceError(f"Zaber's stages need their library. Install it with {BRINGS}.") from error
    try:
        connection = Connection.open_serial_port(settings.port)
    except MotionLibException as error:
        raise DeviceError(
            f"The port {settings.port!r} cannot be opened ({error}). Check the address and the cable, and"
            " that no other program uses it."
        ) from error
    try:
        try:
            devices = connection.detect_devices(identify_devices=not settings.steps_per_mm)
        except MotionLibException as error:
            raise DeviceError(
                f"No stage of Zaber answers on {settings.port!r} ({error}). Check its power; without"
                " internet, state steps_per_mm from its data sheet."
            ) from error
        if settings.device > len(devices):
            raise DeviceError(
                f"There are {len(devices)} devices on {settings.port!r}, not {settings.device}. Correct it."
            )
        axis = devices[settings.device - 1].get_axis(settings.axis)
        return ZaberStage(connection, axis, settings, Units, MotionLibException)
    except BaseException:
        connection.close()
        raise


DRIVER = Driver("Zaber stages", ZaberSettings, open_zaber, brings=BRINGS)
