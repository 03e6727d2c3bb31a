"""Thorlabs' long travel stages LTS150 and LTS300 over their serial port.

Source: Thorlabs, "APT Controllers Host-Controller Communications Protocol": messages for stepper channels and
409,600 counts a millimetre. The controller is asked where it is, and never told to report by itself.
"""

from __future__ import annotations

import struct
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Self

from pydantic import Field, model_validator

from dsl_core.devices.base import Stage
from dsl_core.devices.driver_table import Driver, FoundDevice
from dsl_core.devices.drivers.rail import RailSettings
from dsl_core.devices.drivers.serial_line import BRINGS, SerialLine, open_line, serial_ports
from dsl_core.errors import DeviceError

COUNTS_PER_MM = 409_600
#: Longest way of each model, mm.
TRAVEL_MM = {"LTS150": 150.0, "LTS300": 300.0}
_FTDI = 0x0403
_STAGE, _HOST = 0x50, 0x01
_REQUEST_INFO, _INFO = 0x0005, 0x0006
_ENABLE, _HOME, _MOVE, _STOP = 0x0210, 0x0443, 0x0453, 0x0465
_REQUEST_STATUS, _STATUS = 0x0480, 0x0481
_MOVED, _STOPPED = 0x0464, 0x0466
_ERROR, _RICH_ERROR = 0x0080, 0x0081
#: Messages that come without being asked, with the lengths of their data.
_KNOWN = {_INFO: 84, _STATUS: 14, _MOVED: 14, _STOPPED: 14, 0x0444: 0, _ERROR: 0, _RICH_ERROR: 68}
_AT_LIMIT, _MOVING, _HOMING, _HOMED = 0x3, 0xF0, 0x200, 0x400
_LOST, _OVERLOAD = 0x4000, 0x0100_0000


class LtsSettings(RailSettings):
    """Which stage, and what it may do."""

    port: str = Field(min_length=1, description="serial port, such as /dev/ttyUSB0 or COM4")
    range_mm: tuple[float, float] = Field(
        default=(0.0, 150.0), description="from where to where on its own scale it may go, mm"
    )
    home: bool = Field(
        default=False,
        description="let it find its reference when it has not; it moves to its end, so clear its way first",
    )
    tolerance_mm: float = Field(default=0.01, gt=0, description="how exactly it has to arrive, mm")

    @model_validator(mode="after")
    def _check(self) -> Self:
        low, high = self.range_mm
        if not 0 <= low < high <= max(TRAVEL_MM.values()):
            raise ValueError(f"range_mm is {low:g} to {high:g}; it has to rise within 0 to 300 mm")
        return self


@dataclass(frozen=True)
class Timing:
    """How long things take, s: an answer, between two questions, no progress, finding the reference."""

    answer_s: float = 1.0
    poll_s: float = 0.1
    stalled_s: float = 3.0
    home_s: float = 120.0


@dataclass(frozen=True)
class _Status:
    counts: int
    bits: int

    @property
    def mm(self) -> float:
        return self.counts / COUNTS_PER_MM


class ThorlabsLts(Stage):
    """A stage on an open line; ``sleep`` waits as ``clock`` runs."""

    def __init__(
        self,
        line: SerialLine,
        settings: LtsSettings,
        timing: Timing | None = None,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        """Check what is on the line, and let it find its reference if that is asked for."""
        self._line, self._settings, self._timing = line, settings, timing or Timing()
        self._clock, self._sleep = clock, sleep
        model = self._model()
        travel_mm = next((mm for name, mm in TRAVEL_MM.items() if model.startswith(name)), None)
        if travel_mm is None:
            raise DeviceError(
                f"{line.name} is a {model or 'device without a name'}, not an LTS150 or LTS300, whose counts"
                " per millimetre are known here. Choose the port of the stage."
            )
        if settings.range_mm[1] > travel_mm:
            raise DeviceError(
                f"The {model} moves {travel_mm:g} mm, range_mm goes to {settings.range_mm[1]:g} mm. Make it"
                " smaller."
            )
        self._travel_mm = travel_mm
        line.write(struct.pack("<HBBBB", _ENABLE, 1, 1, _STAGE, _HOST))
        self._require_reference()

    @property
    def range_mm(self) -> tuple[float, float]:
        """Smallest and largest position of the target, mm."""
        low, high = sorted(self._settings.to_target(mm) for mm in self._settings.range_mm)
        return low, high

    @property
    def position_mm(self) -> float:
        """Where the target is, mm."""
        return self._settings.to_target(self._stands_at())

    def _stands_at(self) -> float:
        """Where the stage says that it is, mm; asked twice, as an answer may be an old one."""
        for _ in range(5):
            first, second = self._status(), self._status()
            if abs(first.counts - second.counts) <= self._settings.tolerance_mm * COUNTS_PER_MM:
                return second.mm
        raise DeviceError(f"{self._line.name} moves although it was not asked to. Stop it and try again.")

    def move_to(self, position_mm: float) -> float:
        """Move, wait until it stands still there, and return the position read back, mm."""
        low, high = self.range_mm
        if not low <= position_mm <= high:
            raise DeviceError(
                f"{self._line.name} moves from {low:g} to {high:g} mm, not to {position_mm:g} mm. Choose a"
                " position in its range."
            )
        stage_mm = self._settings.to_stage(position_mm)
        counts = round(stage_mm * COUNTS_PER_MM)
        self._line.drain()
        self._line.write(struct.pack("<HHBBHi", _MOVE, 6, _STAGE | 0x80, _HOST, 1, counts))
        try:
            self._wait(lambda status: self._is_there(status, stage_mm), f"move to {position_mm:g} mm")
        except DeviceError:
            self._stop()
            raise
        reached_mm = self.position_mm
        if abs(reached_mm - position_mm) > self._settings.tolerance_mm:
            raise DeviceError(
                f"{self._line.name} was at {position_mm:g} mm and is now at {reached_mm:g} mm. Check that"
                " nothing pushes it."
            )
        return reached_mm

    def close(self) -> None:
        """Release the port; the stage stays where it is."""
        self._line.close()

    def _is_there(self, status: _Status, stage_mm: float) -> bool:
        return abs(status.mm - stage_mm) <= self._settings.tolerance_mm

    def _require_reference(self) -> None:
        if self._status().bits & _HOMED:
            return
        if not self._settings.home:
            raise DeviceError(
                f"{self._line.name} has not found its reference since it was switched on, so its positions"
                " mean nothing. Clear its way, as it moves to its end, and set home to true."
            )
        self._line.write(struct.pack("<HBBBB", _HOME, 1, 0, _STAGE, _HOST))
        self._wait(lambda status: bool(status.bits & _HOMED), "find its reference", self._timing.home_s)

    def _wait(self, is_done: Callable[[_Status], bool], what: str, most_s: float | None = None) -> None:
        """Ask until it stands still and ``is_done``; raises `DeviceError` when it cannot get there."""
        begun = since = self._clock()
        before: _Status | None = None
        still = 0
        while True:
            status = self._status()
            if status.bits & (_LOST | _OVERLOAD):
                cause = "lost its position" if status.bits & _LOST else "drew too much current"
                raise DeviceError(
                    f"{self._line.name} was to {what} and {cause} at {status.mm:.3f} mm. Check that nothing"
                    " blocks it, switch it off and on, and let it find its reference again."
                )
            is_still = before is not None and status.counts == before.counts
            is_moving = bool(status.bits & (_MOVING | _HOMING))
            still = still + 1 if is_still and not is_moving and is_done(status) else 0
            if still >= 2:
                return
            now = self._clock()
            if not is_still:
                since = now
            if now - since > self._timing.stalled_s:
                where = " at the switch of its end" if status.bits & _AT_LIMIT else ""
                raise DeviceError(
                    f"{self._line.name} was to {what}, but stays at {status.mm:.3f} mm{where}. Check that"
                    " nothing blocks it, and that its switch for local control is off."
                )
            if now - begun > (most_s or self._timing.home_s):
                raise DeviceError(
                    f"{self._line.name} was to {what}, and has not after {now - begun:.0f} s; it is at"
                    f" {status.mm:.3f} mm. Check that nothing slows it down."
                )
            before = status
            self._sleep(self._timing.poll_s)

    def _stop(self) -> None:
        try:
            self._line.write(struct.pack("<HBBBB", _STOP, 1, 1, _STAGE, _HOST))
        except DeviceError:
            return  # the failure that led here says more

    def _model(self) -> str:
        data = self._ask(_REQUEST_INFO, _INFO)
        return bytes(data[4:12]).split(b"\0")[0].decode("ascii", "replace").strip()

    def _status(self) -> _Status:
        for _ in range(3):
            channel, counts, _, bits = struct.unpack("<HiiI", self._ask(_REQUEST_STATUS, _STATUS))
            # A millimetre more, as a stage that was pushed into its end may say so.
            if channel == 1 and -1 <= counts / COUNTS_PER_MM <= self._travel_mm + 1:
                return _Status(counts, bits)
        raise DeviceError(
            f"{self._line.name} says that it is at {counts / COUNTS_PER_MM:g} mm, outside its travel. Switch"
            " it off and on, and let it find its reference again."
        )

    def _ask(self, request: int, answer: int) -> bytes:
        """The data of the answer, past old ones; asked three times, as bytes may get lost."""
        for attempt in range(3):
            self._line.drain(self._timing.answer_s / 20 if attempt else 0.0)
            self._line.write(struct.pack("<HBBBB", request, 1, 0, _STAGE, _HOST))
            data = self._answer(answer)
            if data is not None:
                return data
        raise DeviceError(
            f"{self._line.name} does not answer as a Thorlabs stage does. Check its cable and power, and that"
            " the port is its own; then open the rig again."
        )

    def _answer(self, wanted: int) -> bytes | None:
        """The data of the next message of a kind, past others; None for silence and for rubbish."""
        end = self._clock() + self._timing.answer_s
        while (left_s := end - self._clock()) > 0:
            head = self._line.read(6, left_s)
            if len(head) < 6:
                return None
            message, length, to, source = struct.unpack("<HHBB", head)
            has_data = bool(to & 0x80)
            if message not in _KNOWN or source != _STAGE or (has_data and length != _KNOWN[message]):
                return None
            data = self._line.read(length, left_s) if has_data else b""
            if has_data and len(data) < length:
                return None
            if message in (_ERROR, _RICH_ERROR):
                text = data[4:].split(b"\0")[0].decode("ascii", "replace").strip()
                raise DeviceError(
                    f"{self._line.name} refused what it was asked ({text or 'no reason given'}). Switch it"
                    " off and on, and open the rig again."
                )
            if message == wanted and has_data:
                return data
        return None


def open_lts(settings: LtsSettings) -> ThorlabsLts:
    """Open the stage on a serial port; raises `DeviceError`."""
    line = open_line(settings.port, f"The stage on {settings.port}", 115_200, rtscts=True)
    try:
        return ThorlabsLts(line, settings)
    except BaseException:
        line.close()
        raise


def find_lts() -> list[FoundDevice]:
    """Serial ports with the converter that these stages have; raises `DeviceError`."""
    return [FoundDevice({"port": port}, f"{port} ({words})") for port, words in serial_ports(_FTDI)]


DRIVER = Driver("Thorlabs LTS150 and LTS300", LtsSettings, open_lts, find_lts, BRINGS)
