"""A specbos 1211 that measures a smooth light, and may refuse, clip, forget, or wear its diffuser."""

from __future__ import annotations

import math

NM = range(380, 781)
#: What may go wrong in the instrument itself.
JETI_FAULTS = ("refuses", "never done", "diffuser", "wrong range", "no light", "other maker", "not finite")


def radiance(nm: float) -> float:
    """What it measures, W/(sr m2 nm)."""
    return 0.02 * math.exp(-0.5 * ((nm - 550) / 60) ** 2) + 1e-5


class Jeti:
    """``measure_s`` is how long it exposes."""

    def __init__(self, fault: str = "", measure_s: float = 0.8) -> None:
        self.fault, self._measure_s = fault, measure_s
        self._buffer = b""
        self.settings: list[str] = []

    def take(self, data: bytes, now_s: float) -> list[tuple[float, bytes]]:
        self._buffer += data
        *commands, self._buffer = self._buffer.split(b"\r")
        found: list[tuple[float, bytes]] = []
        for command in commands:
            found += self._one(command.decode("ascii", "replace").strip(), now_s)
        return found

    def _one(self, command: str, now_s: float) -> list[tuple[float, bytes]]:
        soon = now_s + 0.005
        if command == "*IDN?":
            return [(soon, b"ACME_100\r" if self.fault == "other maker" else b"JETI_SB1211\r")]
        if command == "*CONTR:MHEAD?":
            return [(soon, b"Measuring head:\t%d\r" % (self.fault == "diffuser"))]
        if command == "*STAT:ERR?":
            return [(soon, b"Error Code:\t121\r")]
        if command == "*INIT":
            if self.fault == "no light":
                return [(soon, b"\x06"), (soon + self._measure_s, b"\x15")]
            if self.fault == "never done":
                return [(soon, b"\x06")]
            return [(soon, b"\x06"), (soon + self._measure_s, b"\x07")]
        if command.startswith("*FETCH:SPRAD"):
            return [(soon, self._spectrum())]
        if command.startswith("*CONF:"):
            self.settings.append(command)
            return [(soon, b"\x15" if self.fault == "refuses" and "AVER" in command else b"\x06")]
        return [(soon, b"\x15")]

    def _spectrum(self) -> bytes:
        numbers = [nm + (5 if self.fault == "wrong range" else 0) for nm in NM]
        rows = [b"%d\t%.6E\r" % (nm, radiance(nm)) for nm in numbers]
        if self.fault == "not finite":
            rows[40] = b"420\t9.9E+37\r"
        return b"Spectral radiance [W/(sr*m2*nm)]\r\r" + b"".join(rows) + b"\r"
