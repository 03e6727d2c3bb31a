"""An LTS150: it takes time to move, and may be blocked, ignore what it is told, or lose its position."""

from __future__ import annotations

import struct

COUNTS = 409_600
#: What may go wrong in the stage itself.
STAGE_FAULTS = ("blocked", "ignores moves", "loses position", "overload", "creeps back", "refuses", "short")


class Lts:
    """``fault`` happens on the way to the next target; speed in mm/s."""

    def __init__(
        self, fault: str = "", model: bytes = b"LTS150C", is_homed: bool = True, mm_s: float = 20.0
    ) -> None:
        self.fault, self._model, self._mm_s = fault, model, mm_s
        self.is_homed = is_homed
        self.start = self.target = 60.0
        self.since = 0.0
        self.is_homing = False

    def take(self, data: bytes, now_s: float) -> list[tuple[float, bytes]]:
        answers: list[tuple[float, bytes]] = []
        while len(data) >= 6:
            message, length, to, _ = struct.unpack("<HHBB", data[:6])
            body = 6 + (length if to & 0x80 else 0)
            answers += [(now_s + 0.002, each) for each in self._one(message, data[6:body], now_s)]
            data = data[body:]
        return answers

    def position_mm(self, now_s: float) -> float:
        way = self.target - self.start
        share = min(1.0, (now_s - self.since) * self._mm_s / max(abs(way), 1e-9))
        if self.fault == "blocked":
            share = min(share, 0.4)
        if self.fault == "creeps back" and share == 1.0:
            return self.target - min(0.3, 0.1 * (now_s - self.since - abs(way) / self._mm_s))
        return self.start + share * way

    def _one(self, message: int, data: bytes, now_s: float) -> list[bytes]:
        if message == 0x0005:
            info = struct.pack("<I8sH4s60sHHH", 45_000_001, self._model, 16, b"", b"", 1, 0, 1)
            return [self._with_data(0x0006, info)]
        if message == 0x0480:
            return [self._with_data(0x0481, self._status(now_s))]
        if message == 0x0453:
            if self.fault == "refuses":
                return [self._with_data(0x0081, struct.pack("<HH64s", message, 1, b"no such move"))]
            counts = struct.unpack("<Hi", data)[1] if self.fault != "short" else 0
            self._go(counts / COUNTS, now_s)
        if message == 0x0443:
            self._go(0.0, now_s)
            self.is_homing = True
        if message == 0x0465:
            self._go(self.position_mm(now_s), now_s)
        return []

    def _go(self, target_mm: float, now_s: float) -> None:
        if self.fault == "ignores moves":
            return
        self.start, self.target, self.since = self.position_mm(now_s), target_mm, now_s

    def _status(self, now_s: float) -> bytes:
        at = self.position_mm(now_s)
        is_there = abs(at - self.target) < 1e-6
        bits = 0x8000_0000 | 0x100
        if self.is_homing and is_there:
            self.is_homing, self.is_homed = False, True
        bits |= 0x400 if self.is_homed else 0
        if not is_there and self.fault not in ("blocked", "creeps back"):
            bits |= 0x200 if self.is_homing else 0x10
        travelled = abs(at - self.start) > 1.0
        bits |= 0x4000 if self.fault == "loses position" and travelled else 0
        bits |= 0x0100_0000 if self.fault == "overload" and travelled else 0
        return struct.pack("<HiiI", 1, round(at * COUNTS), 0, bits)

    @staticmethod
    def _with_data(message: int, data: bytes) -> bytes:
        return struct.pack("<HHBB", message, len(data), 0x81, 0x50) + data
