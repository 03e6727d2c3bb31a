"""A serial line with time-outs, whose failures are sentences; pyserial is imported when a line is opened."""

from __future__ import annotations

import errno
import os
import time
from collections.abc import Callable
from functools import partial
from typing import Any, Protocol, TypeVar

from dsl_core.errors import DeviceError
from dsl_core.extras import pip_command

T = TypeVar("T")
BRINGS = f"{pip_command('serial')} (pyserial)"
#: Reading waits in steps of this, s, so that what arrives is seen soon.
_STEP_S = 0.05


class SerialPort(Protocol):
    """What is used of a port of pyserial."""

    timeout: float | None

    @property
    def in_waiting(self) -> int:
        """Bytes that have arrived."""

    def read(self, size: int) -> bytes:
        """Up to ``size`` bytes, fewer when the time-out passes."""

    def write(self, data: bytes) -> object:
        """Send bytes."""

    def reset_input_buffer(self) -> None:
        """Forget what has arrived."""

    def close(self) -> None:
        """Release the port."""


class SerialLine:
    """Bytes to and from one instrument, ``name`` in sentences about it.

    ``clock`` tells seconds. Every method raises `DeviceError` where the port fails, as it does when a cable
    is pulled.
    """

    def __init__(self, port: SerialPort, name: str, clock: Callable[[], float] = time.monotonic) -> None:
        self.name, self._port, self._clock, self._is_open = name, port, clock, True
        self._rest = b""

    def write(self, data: bytes) -> None:
        """Send bytes."""
        self._do(lambda: self._port.write(data))

    def read(self, size: int, timeout_s: float) -> bytes:
        """Exactly ``size`` bytes, fewer when ``timeout_s`` passes before."""
        return self._read(lambda got: size if len(got) >= size else None, timeout_s)

    def read_until(self, end: bytes, timeout_s: float, most: int = 1 << 20) -> bytes:
        """Bytes up to and with ``end``, or without it what came in ``timeout_s`` or until ``most`` bytes."""

        def length(got: bytes) -> int | None:
            at = got.find(end)
            return at + len(end) if at >= 0 else most if len(got) >= most else None

        return self._read(length, timeout_s)

    def drain(self, quiet_s: float = 0.0) -> None:
        """Forget what has arrived, and what still arrives until it has been quiet for ``quiet_s``."""
        self._forget()
        end = self._clock() + max(10 * quiet_s, 1.0)
        while quiet_s and self.read(1, quiet_s):
            self._forget()
            if self._clock() > end:
                raise DeviceError(
                    f"{self.name} does not stop sending. Switch it off and on, and check that the port is its"
                    " own."
                )

    def _forget(self) -> None:
        self._do(self._port.reset_input_buffer)
        self._rest = b""

    def close(self) -> None:
        """Release the port; a second call does nothing, and neither does a port that is gone."""
        if self._is_open:
            self._is_open = False
            try:
                self._port.close()
            except OSError:
                return

    def _read(self, length: Callable[[bytes], int | None], timeout_s: float) -> bytes:
        """What is read up to the ``length`` of it that is wanted; what came behind that is kept."""
        got, self._rest = self._rest, b""
        end = self._clock() + timeout_s
        while (wanted := length(got)) is None:
            left_s = end - self._clock()
            if left_s <= 0:
                return got
            got += self._do(partial(self._arrived, min(left_s, _STEP_S)))
        got, self._rest = got[:wanted], got[wanted:]
        return got

    def _arrived(self, wait_s: float) -> bytes:
        self._port.timeout = wait_s  # this too fails on a port that is gone
        return self._port.read(max(1, self._port.in_waiting))

    def _do(self, action: Callable[[], T]) -> T:
        if not self._is_open:
            raise DeviceError(f"{self.name} is closed. Open the rig again.")
        try:
            return action()
        except (OSError, TypeError, ValueError) as error:  # pyserial raises all three when a cable is pulled
            raise DeviceError(
                f"{self.name} no longer answers on its port ({error}). Check its cable and power, then open"
                " the rig again."
            ) from error


def open_line(port: str, name: str, baud: int, rtscts: bool = False) -> SerialLine:
    """Open a serial port; raises `DeviceError` when there is none or pyserial is missing."""
    try:
        import serial
    except ImportError as error:
        raise DeviceError(f"{name} needs the package pyserial. Install it with {BRINGS}.") from error
    try:
        # No waiting for ever: an instrument that holds up writing is as lost as one that does not answer.
        found = serial.Serial(port, baud, timeout=0.1, write_timeout=2.0)
        if rtscts:
            _hand_shake(found)
    except (OSError, ValueError) as error:
        code = getattr(error, "errno", None)
        raise DeviceError(
            f"{name} cannot be opened: {os.strerror(code) if code else error}. {_ports_in_words()} Check port"
            " and cable, and that no other program uses it; on Linux, that you may use serial ports (group"
            " dialout)."
        ) from error
    return SerialLine(found, name)


def _ports_in_words() -> str:
    there = ", ".join(address for address, _ in serial_ports())
    return f"This computer's serial ports are: {there}." if there else "This computer has no serial port."


def _hand_shake(port: Any) -> None:
    """Switch hardware flow control on, where a port has the lines for it; a virtual one has not."""
    try:
        port.rtscts = True
    except OSError as error:
        if error.errno != errno.ENOTTY:
            raise
        port.rtscts = False


def serial_ports(vendor: int | None = None) -> list[tuple[str, str]]:
    """Address and description of every serial port, of one USB vendor or all; raises `DeviceError`."""
    try:
        from serial.tools import list_ports
    except ImportError as error:
        raise DeviceError(f"Serial ports are listed by pyserial. Install it with {BRINGS}.") from error
    return [(each.device, each.description) for each in list_ports.comports() if vendor in (None, each.vid)]
