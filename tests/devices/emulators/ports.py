"""Instruments behind a serial port: a port in memory with a clock of its own, and faults between the two."""

from __future__ import annotations

import heapq
import random
from collections.abc import Callable
from typing import Protocol


class Instrument(Protocol):
    """An emulated instrument: takes the bytes that are sent to it at a time (s), and says what it answers."""

    def take(self, data: bytes, now_s: float) -> list[tuple[float, bytes]]:
        """Answers, each with the time (s) at which it is sent."""


#: What may go wrong on the way, whatever the instrument. Each happens from the n-th answer on.
FAULTS = (
    *("silent", "silent once", "rubbish", "rubbish once", "rubbish before", "dropped", "truncated"),
    *("truncated once", "late once", "duplicate", "flipped", "flipped once", "echo"),
)


class Faulty:
    """An instrument whose answers are spoiled from the ``at``-th on."""

    def __init__(self, inner: Instrument, fault: str, at: int, seed: int) -> None:
        self._inner, self._fault, self._at, self._random = inner, fault, at, random.Random(seed)
        self.answers = 0
        self.is_dropped = False

    def take(self, data: bytes, now_s: float) -> list[tuple[float, bytes]]:
        spoiled: list[tuple[float, bytes]] = []
        if self._fault == "echo":
            spoiled.append((now_s, data))
        for when, answer in self._inner.take(data, now_s):
            self.answers += 1
            is_due = self.answers >= self._at
            if self._fault.endswith(" once"):
                is_due = self.answers == self._at
            spoiled += self._spoil(when, answer) if is_due else [(when, answer)]
        return spoiled

    def _spoil(self, when: float, answer: bytes) -> list[tuple[float, bytes]]:
        draw = self._random
        kind = self._fault.removesuffix(" once")
        rubbish = bytes(draw.randrange(256) for _ in range(draw.randrange(1, 40)))
        if kind == "dropped":
            self.is_dropped = True
        if kind in ("silent", "dropped"):
            return []
        if kind == "rubbish":
            return [(when, rubbish)]
        if kind == "rubbish before":
            return [(when, rubbish), (when, answer)]
        if kind == "truncated":
            return [(when, answer[: draw.randrange(len(answer))])]
        if kind == "late":
            return [(when + draw.uniform(0.5, 4.0), answer)]
        if kind == "duplicate":
            return [(when, answer), (when, answer)]
        if kind == "flipped":
            changed = bytearray(answer)
            changed[draw.randrange(len(changed))] ^= 1 << draw.randrange(8)
            return [(when, bytes(changed))]
        return [(when, answer)]


class FakePort:
    """A port of pyserial in memory; reading with nothing there lets its clock run instead of waiting."""

    def __init__(self, instrument: Instrument) -> None:
        self._timeout: float | None = 0.1
        self.now_s = 0.0
        self.is_closed = False
        self._instrument = instrument
        self._coming: list[tuple[float, int, bytes]] = []
        self._buffer = b""
        self._count = 0

    def clock(self) -> float:
        return self.now_s

    def sleep(self, seconds: float) -> None:
        self.now_s += seconds

    @property
    def timeout(self) -> float | None:
        return self._timeout

    @timeout.setter
    def timeout(self, seconds: float | None) -> None:
        self._require()
        self._timeout = seconds

    @property
    def in_waiting(self) -> int:
        self._require()
        self._arrive()
        return len(self._buffer)

    def write(self, data: bytes) -> object:
        self._require()
        for when, answer in self._instrument.take(data, self.now_s):
            self._count += 1
            heapq.heappush(self._coming, (when, self._count, answer))
        return len(data)

    def read(self, size: int) -> bytes:
        self._require()
        self._arrive()
        if len(self._buffer) < size:
            end = self.now_s + (self._timeout or 0.0)
            while self._coming and self._coming[0][0] <= end and len(self._buffer) < size:
                self.now_s = max(self.now_s, self._coming[0][0])
                self._arrive()
            if len(self._buffer) < size:
                self.now_s = end
        got, self._buffer = self._buffer[:size], self._buffer[size:]
        return got

    def reset_input_buffer(self) -> None:
        self._require()
        self._arrive()
        self._buffer = b""

    def close(self) -> None:
        self.is_closed = True

    def _arrive(self) -> None:
        while self._coming and self._coming[0][0] <= self.now_s:
            self._buffer += heapq.heappop(self._coming)[2]

    def _require(self) -> None:
        if getattr(self._instrument, "is_dropped", False):
            raise OSError(5, "Input/output error")


def ends(action: Callable[[], float | None], is_right: Callable[[float | None], bool]) -> str:
    """How an action under a fault ends: right, stopped (with a reason), or wrong."""
    from dsl_core.errors import DeviceError

    try:
        value = action()
    except DeviceError as error:
        return "stopped" if len(str(error)) > 40 and str(error).endswith(".") else f"no reason: {error}"
    return "right" if is_right(value) else f"wrong: {value}"
