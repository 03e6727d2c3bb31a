"""Packed and unpacked pixels are read bit by bit as the naming convention lays them out."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from dsl_core.devices.drivers.genicam.pixel_formats import best_format, pixel_format, right_aligned
from dsl_core.errors import DeviceError

WIDTH, HEIGHT = 5, 3


def packed(values: NDArray[np.uint16], bits: int, kind: str) -> bytes:
    """Pixels packed one bit at a time, apart from the code under test."""
    flat = [int(v) for v in values.ravel()]
    if kind == "p":
        number = sum(value << (bits * i) for i, value in enumerate(flat))
        return number.to_bytes(-(-len(flat) * bits // 8), "little")
    flat += [0] * (len(flat) % 2)
    out = bytearray()
    low = bits - 8
    for first, second in zip(flat[::2], flat[1::2], strict=True):
        middle = (first % (1 << low)) | ((second % (1 << low)) << 4)
        out += bytes([first >> low, middle, second >> low])
    return bytes(out)


@pytest.mark.parametrize("bits", [10, 12])
@pytest.mark.parametrize("kind", ["p", "Packed"])
def test_packed_pixels_come_out_whole(bits: int, kind: str) -> None:
    values = np.random.default_rng(bits).integers(0, 1 << bits, (HEIGHT, WIDTH), dtype=np.uint16)
    values[0, :2] = (1 << bits) - 1, 0
    chosen = pixel_format(f"BayerGB{bits}{kind}")
    assert chosen is not None
    assert (chosen.mosaic, chosen.bits) == ("GBRG", bits)
    # A buffer may be longer than its picture.
    found = chosen.unpack(packed(values, bits, kind) + b"rest", WIDTH, HEIGHT)
    np.testing.assert_array_equal(found, values)
    assert found.dtype == np.uint16


def test_whole_bytes_are_copied() -> None:
    data = bytearray(range(30))
    eight, sixteen = pixel_format("Mono8"), pixel_format("BayerRG16")
    assert eight is not None
    assert sixteen is not None
    first = eight.unpack(memoryview(data), WIDTH, HEIGHT)
    second = sixteen.unpack(memoryview(data), WIDTH, HEIGHT)
    data[:] = bytes(30)
    assert first.ravel().tolist() == list(range(15))
    assert second[0, :2].tolist() == [1 << 8, 2 | 3 << 8]


def test_a_frame_that_is_cut_off_is_refused() -> None:
    chosen = pixel_format("Mono12p")
    assert chosen is not None
    with pytest.raises(DeviceError, match="has 23 bytes, and 22 arrived"):
        chosen.unpack(bytes(22), WIDTH, HEIGHT)


@pytest.mark.parametrize("name", ["RGB8", "YUV422_8", "Mono8p", "Mono8s", "BayerRG16p", "BayerXX8", ""])
def test_other_formats_are_not_raw(name: str) -> None:
    assert pixel_format(name) is None


def test_the_deepest_raw_format_is_best_and_a_mosaic_before_brightness() -> None:
    assert best_format(["Mono16", "RGB8", "BayerRG8", "BayerRG12p", "BayerRG12Packed"]).name == "BayerRG12p"
    assert best_format(["Mono8", "Mono12"]).name == "Mono12"
    with pytest.raises(DeviceError, match="no raw pixel format; it offers RGB8, YUV8"):
        best_format(["RGB8", "YUV8"])


def test_left_aligned_pixels_move_down_unless_they_are_not() -> None:
    pixels = np.array([[0x0010, 0xFFF0]], np.uint16)
    assert right_aligned(pixels, 4).tolist() == [[1, 4095]]
    np.testing.assert_array_equal(right_aligned(pixels, 0), pixels)
    with pytest.raises(DeviceError, match="lowest 4 of 16 bits"):
        right_aligned(pixels + np.uint16(1), 4)
