"""A file of camera raw as a photographic camera or its converter writes it: a DNG with a mosaic as it is."""

from __future__ import annotations

import struct

import numpy as np
from numpy.typing import NDArray

_BYTE, _ASCII, _SHORT, _LONG, _RATIONAL, _SIGNED_RATIONAL = 1, 2, 3, 4, 5, 10
_LETTERS = {_BYTE: "B", _SHORT: "H", _LONG: "I", _RATIONAL: "I", _SIGNED_RATIONAL: "i"}
_STRIP_OFFSETS = 273


def dng(values: NDArray[np.unsignedinteger], bayer: str = "RGGB", white: int = 16383) -> bytes:
    """An uncompressed DNG 1.4 of a mosaic (rows, columns), with black at 512 DN."""
    rows, columns = values.shape
    pixels = values.astype("<u2").tobytes()
    identity = [1, 1, 0, 1, 0, 1, 0, 1, 1, 1, 0, 1, 0, 1, 0, 1, 1, 1]
    colours = ["RGB".index(letter) for letter in bayer]
    # Uncompressed (259), a colour filter array (262, 33421, 33422), levels of black and white (50714, 50717);
    # then a matrix, neutral colour and light of which nothing here makes use.
    tags: list[tuple[int, int, list[int] | bytes]] = [
        *((254, _LONG, [0]), (256, _LONG, [columns]), (257, _LONG, [rows]), (258, _SHORT, [16])),
        *((259, _SHORT, [1]), (262, _SHORT, [32803]), (271, _ASCII, b"Example\0"), (272, _ASCII, b"One\0")),
        *((_STRIP_OFFSETS, _LONG, [0]), (277, _SHORT, [1]), (278, _LONG, [rows])),
        *((279, _LONG, [len(pixels)]), (33421, _SHORT, [2, 2]), (33422, _BYTE, colours)),
        *((50706, _BYTE, [1, 4, 0, 0]), (50707, _BYTE, [1, 1, 0, 0]), (50708, _ASCII, b"Example One\0")),
        *((50714, _SHORT, [512]), (50717, _SHORT, [white]), (50721, _SIGNED_RATIONAL, identity)),
        *((50728, _RATIONAL, [1, 1] * 3), (50778, _SHORT, [21])),
    ]
    behind = 8 + 2 + 12 * len(tags) + 4
    longer = b"".join(_padded(kind, value) for _, kind, value in tags if len(_packed(kind, value)) > 4)
    entries, at = b"", behind
    for tag, kind, value in tags:
        packed = _packed(kind, [behind + len(longer)] if tag == _STRIP_OFFSETS else value)
        size = {_RATIONAL: 8, _SIGNED_RATIONAL: 8, _SHORT: 2, _LONG: 4}.get(kind, 1)
        entries += struct.pack("<HHI", tag, kind, len(packed) // size)
        entries += packed.ljust(4, b"\0") if len(packed) <= 4 else struct.pack("<I", at)
        at += len(_padded(kind, value)) if len(packed) > 4 else 0
    return b"II" + struct.pack("<HIH", 42, 8, len(tags)) + entries + struct.pack("<I", 0) + longer + pixels


def _packed(kind: int, value: list[int] | bytes) -> bytes:
    return value if isinstance(value, bytes) else struct.pack(f"<{len(value)}{_LETTERS[kind]}", *value)


def _padded(kind: int, value: list[int] | bytes) -> bytes:
    packed = _packed(kind, value)
    return packed + b"\0" * (len(packed) % 2)
