"""Pixel formats of GenICam by name, and their frames as right-aligned uint16.

Names and layouts are those of the Pixel Format Naming Convention (EMVA, 2.4) and, for names that end in
``Packed``, of GigE Vision 1.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from dsl_core.errors import DeviceError
from dsl_core.model.conditions import BayerPattern

Packing = Literal["", "p", "Packed"]
_NAME = re.compile(r"(Mono|Bayer(?:RG|GR|GB|BG))(8|10|12|14|16)(p|Packed)?")
_MOSAIC: dict[str, BayerPattern] = {
    "Mono": "MONO",
    "BayerRG": "RGGB",
    "BayerGR": "GRBG",
    "BayerGB": "GBRG",
    "BayerBG": "BGGR",
}
#: Deepest first; of those, unpacked before packed, as they need no work.
_PREFERENCE = ("16", "14", "12", "12p", "12Packed", "10", "10p", "10Packed", "8")


@dataclass(frozen=True)
class PixelFormat:
    """Raw pixels of one colour each: ``bits`` a pixel, in whole bytes, or packed without gaps."""

    name: str
    mosaic: BayerPattern
    bits: int
    packing: Packing = ""

    @property
    def bits_stored(self) -> int:
        """Bits that a pixel takes in a frame's data, on average."""
        if self.packing == "p":
            return self.bits
        return 12 if self.packing == "Packed" else (8 if self.bits == 8 else 16)

    def size_bytes(self, width: int, height: int) -> int:
        """Length of a frame's data."""
        return -(-width * height * self.bits_stored // 8)

    def unpack(self, data: bytes | memoryview, width: int, height: int) -> NDArray[np.uint16]:
        """A frame's pixels, a copy, shape (height, width); raises `DeviceError` where data is missing."""
        wanted, count = self.size_bytes(width, height), width * height
        if len(data) < wanted:
            raise DeviceError(
                f"A frame of {width} x {height} pixels in {self.name} has {wanted} bytes, and {len(data)}"
                " arrived. Lower the frame rate or the packet size."
            )
        raw = np.frombuffer(data, np.uint8, wanted)
        values: NDArray[np.unsignedinteger]
        if self.packing:
            values = _bits(raw, count, self.bits) if self.packing == "p" else _pairs(raw, count, self.bits)
        else:
            values = raw if self.bits == 8 else raw.view("<u2")
        return values.astype(np.uint16).reshape(height, width)


def pixel_format(name: str) -> PixelFormat | None:
    """The format of a name; None for one that is not raw pixels, or that is not known here.

    >>> pixel_format("BayerRG12p")
    PixelFormat(name='BayerRG12p', mosaic='RGGB', bits=12, packing='p')
    """
    found = _NAME.fullmatch(name)
    if found is None or (found[3] and found[2] not in ("10", "12")):
        return None
    packing: Packing = "p" if found[3] == "p" else ("Packed" if found[3] else "")
    return PixelFormat(name, _MOSAIC[found[1]], int(found[2]), packing)


def best_format(names: list[str]) -> PixelFormat:
    """The deepest raw format of a camera, its mosaic before brightness; raises `DeviceError` without any."""
    known = [each for each in map(pixel_format, names) if each is not None]
    if not known:
        offered = ", ".join(names) or "none"
        raise DeviceError(
            f"The camera has no raw pixel format; it offers {offered}. A camera that delivers Mono or Bayer"
            " pixels of 8 to 16 bits is needed."
        )
    return min(known, key=lambda f: (f.mosaic == "MONO", _PREFERENCE.index(f"{f.bits}{f.packing}")))


def right_aligned(pixels: NDArray[np.uint16], unused_bits: int) -> NDArray[np.uint16]:
    """Pixels whose lowest bits are unused, moved down; raises `DeviceError` when those bits are used."""
    if unused_bits and bool((pixels & ((1 << unused_bits) - 1)).any()):
        raise DeviceError(
            f"The camera's pixels use the lowest {unused_bits} of 16 bits, so they are not"
            f" {16 - unused_bits} bits moved up. Set adc_bits to 16 in the profile, or leave it out."
        )
    return pixels >> np.uint16(unused_bits)


def _bits(raw: NDArray[np.uint8], count: int, bits: int) -> NDArray[np.uint16]:
    """Values of 10 or 12 bits without gaps, the lowest bit first."""
    start = bits * np.arange(count)
    low, shift = start // 8, (start % 8).astype(np.uint16)
    padded = np.append(raw, np.zeros(2, np.uint8)).astype(np.uint16)
    # Ten bits that start at bit 6 end in the second byte, so two bytes always hold a value.
    return ((padded[low] | (padded[low + 1] << np.uint16(8))) >> shift) & np.uint16((1 << bits) - 1)


def _pairs(raw: NDArray[np.uint8], count: int, bits: int) -> NDArray[np.uint16]:
    """Two values in three bytes: the high bits of both in the outer ones, the low bits of both between."""
    low_bits = bits - 8
    triples = np.append(raw, np.zeros(-len(raw) % 3, np.uint8)).reshape(-1, 3).astype(np.uint16)
    mask, shift = np.uint16((1 << low_bits) - 1), np.uint16(low_bits)
    first = (triples[:, 0] << shift) | (triples[:, 1] & mask)
    second = (triples[:, 2] << shift) | ((triples[:, 1] >> np.uint16(4)) & mask)
    return np.stack([first, second], 1).ravel()[:count]
