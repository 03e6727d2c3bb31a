"""JETI's specbos 1211 and its relatives over their serial port, in lines that end with a carriage return.

The instrument acknowledges a setting with one byte, refuses it with another, and tells with a third that a
measurement is done. It sends its spectra without a checksum, so each is fetched until two copies agree.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Self

from pydantic import Field, model_validator

from dsl_core.devices.base import Spectroradiometer
from dsl_core.devices.driver_table import Driver, FoundDevice
from dsl_core.devices.drivers.serial_line import BRINGS, SerialLine, open_line, serial_ports
from dsl_core.errors import DeviceError
from dsl_core.model.base import Record
from dsl_core.model.spectral import SpectralCurve

BAUDS = (921_600, 115_200, 38_400)
_FTDI = 0x0403
_TAKEN, _REFUSED, _DONE = b"\x06", b"\x15", b"\x07"
#: More than the Sun's disc, W/(sr m2 nm).
_MOST_RADIANCE = 1e5
_HEADS = {"0": "radiance", "1": "irradiance (diffuser)"}
_ROW = re.compile(rb"(\d{3,4}(?:\.\d+)?)\s+([-+]?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?)")


class JetiSettings(Record):
    """Which instrument, and how it measures."""

    port: str = Field(min_length=1, description="serial port, such as /dev/ttyUSB0 or COM4")
    baud: int = Field(default=0, ge=0, description="speed of the port; 0 tries those that JETI uses")
    range_nm: tuple[int, int] = Field(default=(380, 780), description="first and last wavelength, nm")
    average: int = Field(default=1, ge=1, le=100, description="exposures that are averaged")
    most_exposure_ms: int = Field(default=60_000, ge=1, description="longest exposure that it may choose, ms")
    cycle_us: int = Field(
        default=0, ge=0, description="cycle of the light's flicker to synchronise with, microseconds; 0: none"
    )

    @model_validator(mode="after")
    def _check(self) -> Self:
        low, high = self.range_nm
        if not 350 <= low < high <= 1000 or low > 430 or high < 660:
            raise ValueError(f"range_nm is {low} to {high}; it has to include 430 to 660 within 350 to 1000")
        return self


@dataclass(frozen=True)
class Patience:
    """How long things may take, s: an answer, all lines of a spectrum, a measurement beyond its exposures."""

    answer_s: float = 2.0
    spectrum_s: float = 20.0
    measure_s: float = 60.0


class JetiSpecbos(Spectroradiometer):
    """An instrument on an open line."""

    def __init__(self, line: SerialLine, settings: JetiSettings, patience: Patience | None = None) -> None:
        """Set up nothing yet; see `set_up`."""
        self._line, self._settings, self._patience = line, settings, patience or Patience()

    def identify(self) -> None:
        """Raise `DeviceError` unless an instrument of JETI answers."""
        name = self._question("*IDN?")
        if "JETI" not in name.upper():
            raise DeviceError(
                f"{self._line.name} answers {name[:40]!r}; an instrument of JETI answers with its maker's"
                " name. Choose its port, and its speed."
            )

    def set_up(self) -> None:
        """Send all settings; raises `DeviceError`."""
        settings = self._settings
        low, high = settings.range_nm
        self._set(f"*CONF:WRAN {low} {high} 1")
        self._set("*CONF:FUNC 6")
        self._set("*CONF:EXPO 1")
        self._set(f"*CONF:MAXTIN {settings.most_exposure_ms}")
        self._set(f"*CONF:AVER {settings.average}")
        self._set(f"*CONF:CYCMOD {1 if settings.cycle_us else 0}")
        if settings.cycle_us:
            self._set(f"*CONF:CYCTIM {settings.cycle_us}")

    def measure(self) -> SpectralCurve:
        """Measure once, W/(sr m2 nm); raises `DeviceError`."""
        head = re.sub(r"[^0-9]", "", self._question("*CONTR:MHEAD?"))
        if head != "0":
            raise DeviceError(
                f"{self._line.name} has its head for {_HEADS.get(head, 'something unknown')}; radiance is"
                " needed. Take the diffuser off."
            )
        self._set("*INIT")
        self._wait()
        before: tuple[tuple[int, float], ...] | None = None
        for _ in range(5):
            rows = self._fetch()
            if rows is not None and rows == before:
                nm, values = zip(*rows, strict=True)
                return SpectralCurve.of(nm, values, unit="W/(sr m2 nm)")
            before = rows
        raise DeviceError(
            f"{self._line.name} sent its spectrum five times without two copies that agree. Use a shorter"
            " cable, or a lower speed of the port."
        )

    def close(self) -> None:
        """Release the port."""
        self._line.close()

    def _wait(self) -> None:
        settings = self._settings
        most_s = self._patience.measure_s + 2e-3 * settings.most_exposure_ms * settings.average
        while True:
            got = self._line.read(1, most_s)
            if got == _DONE:
                return
            if got != _TAKEN:  # a second acknowledgement says nothing new
                what = "refused to measure" if got == _REFUSED else "did not finish a measurement"
                raise DeviceError(
                    f"{self._line.name} {what}{self._reason()}. Check that there is light and that nothing"
                    " moves, then measure again."
                )

    def _fetch(self) -> tuple[tuple[int, float], ...] | None:
        """Wavelengths (nm) and values of the last measurement, None where they are not complete."""
        self._line.drain(self._patience.answer_s / 20)
        self._line.write(b"*FETCH:SPRAD 7\r")
        low, high = self._settings.range_nm
        text = b""
        for _ in range(2):  # the header ends as the spectrum does
            text = self._line.read_until(b"\r\r", self._patience.spectrum_s)
            lines = [line.strip() for line in text.split(b"\r") if line.strip()]
            rows = [_ROW.fullmatch(line) for line in lines]
            if text.endswith(b"\r\r") and sum(row is not None for row in rows) > 1:
                break
        else:
            return None
        found = [(float(row[1]), float(row[2])) for row in rows if row is not None]
        if any(row is None for row in rows) or [nm for nm, _ in found] != list(range(low, high + 1)):
            return None
        if not all(math.isfinite(value) and abs(value) < _MOST_RADIANCE for _, value in found):
            return None
        return tuple((int(nm), value) for nm, value in found)

    def _set(self, command: str) -> None:
        """Send a setting; raises `DeviceError` unless it is acknowledged."""
        for _ in range(2):
            self._line.drain()
            self._line.write(command.encode("ascii") + b"\r")
            got = self._line.read(1, self._patience.answer_s)
            if got == _TAKEN:
                return
            if got == _REFUSED:
                raise DeviceError(
                    f"{self._line.name} refused {command!r}{self._reason()}. Check that it is an instrument"
                    " with these settings, and change them."
                )
            self._line.drain(self._patience.answer_s / 20)
        raise DeviceError(
            f"{self._line.name} did not acknowledge {command!r}. Check its cable and power, then open the rig"
            " again."
        )

    def _reason(self) -> str:
        try:
            said = self._question("*STAT:ERR?")
        except DeviceError:
            return ""
        return f" ({said[:60]})"

    def _question(self, command: str) -> str:
        """The answer without its label; raises `DeviceError` where none comes."""
        for _ in range(2):
            self._line.drain(self._patience.answer_s / 20)
            self._line.write(command.encode("ascii") + b"\r")
            got = self._line.read_until(b"\r", self._patience.answer_s, most=200)
            if got.endswith(b"\r") and got.strip().isascii() and got.strip(b"\r\n \x06\x07").strip():
                text = got.decode("ascii").strip("\r\n \t\x06\x07")
                return text.rpartition("\t")[2].strip()
        raise DeviceError(
            f"{self._line.name} does not answer {command!r}. Check its cable and power, and the speed of the"
            " port."
        )


def open_jeti(
    settings: JetiSettings,
    connect: Callable[[str, str, int], SerialLine] = open_line,
    patience: Patience | None = None,
) -> JetiSpecbos:
    """Open the instrument at the speed of its port, or at that of `BAUDS` which it answers.

    Raises `DeviceError`.
    """
    failures = []
    for baud in (settings.baud,) if settings.baud else BAUDS:
        line = connect(settings.port, f"The spectroradiometer on {settings.port}", baud)
        instrument = JetiSpecbos(line, settings, patience)
        try:
            instrument.identify()
        except DeviceError as error:
            line.close()
            failures.append(error)
            continue
        try:
            instrument.set_up()
        except BaseException:
            line.close()
            raise
        return instrument
    raise failures[0]


def find_jeti() -> list[FoundDevice]:
    """Serial ports with the converter that these instruments have; raises `DeviceError`."""
    return [FoundDevice({"port": port}, f"{port} ({words})") for port, words in serial_ports(_FTDI)]


DRIVER = Driver("JETI specbos 1211", JetiSettings, open_jeti, find_jeti, BRINGS)
