"""What the heads of TIFF and PFM say of their pictures, also of kinds that Pillow does not know."""

from __future__ import annotations

import re
import struct
from dataclasses import dataclass

_PFM = re.compile(rb"P[Ff]\s+(\d{1,9})\s+(\d{1,9})\s")
#: Tags of TIFF (revision 6.0), and how many bytes a number of a kind has.
_WIDTH, _HEIGHT, _BITS, _LIGHT, _SAMPLES, _PLANES = 256, 257, 258, 262, 277, 284
_FORMS = {1: "B", 3: "H", 4: "I", 16: "Q"}
_APART, _WHITE_IS_ZERO = 2, 0


@dataclass(frozen=True)
class Head:
    """One picture of a file.

    ``is_apart``: the planes of its colours follow each other; ``is_negative``: its smallest value is white.
    """

    width_px: int
    height_px: int
    bits: int
    is_apart: bool = False
    is_negative: bool = False


def heads_of(data: bytes, most: int) -> list[Head]:
    """Pictures of a TIFF or PFM, at most so many; empty for other formats and damaged heads."""
    pfm = _PFM.match(data)
    if pfm is not None:
        return [Head(int(pfm[1]), int(pfm[2]), 32)]
    order = {b"II": "<", b"MM": ">"}.get(data[:2], "")
    try:
        version = struct.unpack_from(f"{order}H", data, 2)[0] if order else 0
        return _pages(data, order, version == 43, most) if version in (42, 43) else []
    except (struct.error, OverflowError):
        return []


def _pages(data: bytes, order: str, is_big: bool, most: int) -> list[Head]:
    """All pages of a TIFF; in a big one, places have eight bytes instead of four."""
    place, size, count = ("Q", 8, "Q") if is_big else ("I", 4, "H")
    (at,) = struct.unpack_from(order + place, data, 8 if is_big else 4)
    found: list[Head] = []
    seen: set[int] = set()
    while at and at not in seen and len(found) < most:
        seen.add(at)
        (entries,) = struct.unpack_from(order + count, data, at)
        first, length = at + struct.calcsize(count), 4 + 2 * size
        tags = {}
        for entry in range(first, first + entries * length, length):
            tag, kind, many = struct.unpack_from(f"{order}HH{place}", data, entry)
            if tag in (_WIDTH, _HEIGHT, _BITS, _LIGHT, _SAMPLES, _PLANES) and kind in _FORMS:
                tags[tag] = _number(data, order + _FORMS[kind], many, entry + 4 + size, order + place)
        is_apart = tags.get(_PLANES) == _APART and tags.get(_SAMPLES, 1) > 1
        is_negative = tags.get(_LIGHT) == _WHITE_IS_ZERO
        size_px = tags.get(_WIDTH, 0), tags.get(_HEIGHT, 0)
        found.append(Head(*size_px, tags.get(_BITS, 1), is_apart, is_negative))
        (at,) = struct.unpack_from(order + place, data, first + entries * length)
    return found


def _number(data: bytes, form: str, many: int, at: int, place: str) -> int:
    """The first number of a tag, which is elsewhere where all do not fit into the tag."""
    if many * struct.calcsize(form) > struct.calcsize(place):
        (at,) = struct.unpack_from(place, data, at)
    return int(struct.unpack_from(form, data, at)[0])
