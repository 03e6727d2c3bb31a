"""Size and type of a PNG from its first and last bytes, without decoding it (PNG specification, 11.2)."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from pathlib import Path

_SIGNATURE = b"\x89PNG\r\n\x1a\n"
_END = b"\0\0\0\0IEND\xaeB`\x82"
_CHANNELS = {0: 1, 2: 3, 3: 1, 4: 2, 6: 4}


@dataclass(frozen=True)
class PngInfo:
    """What a PNG's header says; ``bits`` is per channel."""

    width_px: int
    height_px: int
    bits: int
    channels: int


def probe_png(path: Path) -> PngInfo | str:
    """The header of a PNG, or in words why the file is not a whole one."""
    try:
        with path.open("rb") as file:
            head = file.read(33)
            file.seek(max(path.stat().st_size - len(_END), 0))
            tail = file.read()
    except OSError as error:
        return f"cannot be read ({error.strerror})"
    if len(head) < 33 or not head.startswith(_SIGNATURE) or head[12:16] != b"IHDR":
        return "is not a PNG image"
    if tail != _END:
        return "is cut off"
    width, height, bits, colour = struct.unpack(">IIBB", head[16:26])
    return PngInfo(width, height, bits, _CHANNELS.get(colour, 0))
