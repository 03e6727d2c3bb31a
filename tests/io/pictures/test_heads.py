"""Pictures whose heads one library does not know, and those that another reads wrong."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Literal

import numpy as np
import pytest
from numpy.typing import NDArray

from dsl_core.errors import StoreError
from dsl_core.io.pictures.heads import Head, heads_of
from dsl_core.io.pictures.picture_file import Picture, load_values, pictures_in

RGB = np.random.default_rng(0).integers(0, 65535, (6, 8, 3)).astype(np.uint16)
FORMATS = {"u": 1, "i": 2, "f": 3}


def tiff(
    *pages: NDArray[np.generic], apart: bool = False, order: Literal["<", ">"] = "<", big: bool = False
) -> bytes:
    """A TIFF without compression as its specification (revision 6.0) says, of either size of places."""
    place, size = ("Q", 8) if big else ("I", 4)
    numbers = (43, 8, 0) if big else (42,)
    content = struct.pack(f"{order}2s{len(numbers)}H", b"II" if order == "<" else b"MM", *numbers)
    links = [len(content)]
    content += bytes(size)
    for page in pages:
        planes = np.moveaxis(page, -1, 0) if apart else page[None]
        stored = [plane.astype(page.dtype.newbyteorder(order)).tobytes() for plane in planes]
        starts = [len(content) + i * len(stored[0]) for i in range(len(stored))]
        content += b"".join(stored)
        here = struct.pack(order + place, len(content))
        content = content[: links[-1]] + here + content[links[-1] + size :]
        tags = _tags(page, apart, starts, 16 if big else 4)
        links.append(len(content) + (8 if big else 2) + len(tags) * (4 + 2 * size))
        content += _directory(tags, links[-1] + size, order, place)
    return content


def _tags(
    page: NDArray[np.generic], apart: bool, starts: list[int], kind: int
) -> list[tuple[int, int, list[int]]]:
    """Number, kind and values of each tag."""
    samples = 1 if page.ndim == 2 else 3
    return [
        *((256, 3, [page.shape[1]]), (257, 3, [page.shape[0]]), (258, 3, [8 * page.itemsize] * samples)),
        *((259, 3, [1]), (262, 3, [2 if samples > 1 else 1]), (273, kind, starts), (277, 3, [samples])),
        *((278, 3, [page.shape[0]]), (279, kind, [page.nbytes // len(starts)] * len(starts))),
        *((284, 3, [2 if apart else 1]), (339, 3, [FORMATS[page.dtype.kind]] * samples)),
    ]


def _directory(tags: list[tuple[int, int, list[int]]], beyond: int, order: str, place: str) -> bytes:
    """Entries, a place for that of the next directory, and ``beyond`` it what is longer than an entry."""
    size = struct.calcsize(place)
    entries, rest = struct.pack(order + ("Q" if size == 8 else "H"), len(tags)), b""
    for tag, kind, values in tags:
        form = {3: "H", 4: "I", 16: "Q"}[kind]
        data = struct.pack(f"{order}{len(values)}{form}", *values)
        entries += struct.pack(f"{order}HH{place}", tag, kind, len(values))
        is_short = len(data) <= size
        entries += data.ljust(size, b"\0") if is_short else struct.pack(order + place, beyond + len(rest))
        rest += b"" if is_short else data
    return entries + bytes(size) + rest


def read(path: Path, content: bytes) -> NDArray[np.generic]:
    path.write_bytes(content)
    return load_values(Picture(path))


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("big", [False, True])
def test_separate_planes_are_read_right_or_refused(
    tmp_path: Path, order: Literal["<", ">"], big: bool
) -> None:
    small = (RGB >> 8).astype(np.uint8)
    np.testing.assert_array_equal(
        read(tmp_path / "a.tif", tiff(small, apart=True, order=order, big=big)), small
    )
    np.testing.assert_array_equal(read(tmp_path / "b.tif", tiff(RGB, order=order, big=big)), RGB)
    for values, bits in ((RGB, 16), ((RGB / 65535).astype(np.float32), 32)):
        with pytest.raises(StoreError, match=rf"c\.tif stores its colours as separate planes of {bits} bits"):
            read(tmp_path / "c.tif", tiff(values, apart=True, order=order, big=big))


@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
def test_pictures_whose_zero_is_white_are_read_as_positives(tmp_path: Path, kind: type) -> None:
    grey: NDArray[np.generic] = (RGB[..., 0] >> (8 if kind is np.uint8 else 0)).astype(kind)
    content = bytearray(tiff(np.iinfo(kind).max - grey))
    at = struct.unpack_from("<I", content, 4)[0] + 2 + 4 * 12
    assert struct.unpack_from("<HHII", content, at)[0] == 262
    struct.pack_into("<HHII", content, at, 262, 3, 1, 0)
    np.testing.assert_array_equal(read(tmp_path / "a.tif", bytes(content)), grey)


def test_pfm_in_colour_and_tiff_of_64_bits_are_read(tmp_path: Path) -> None:
    colour = (RGB / 65535).astype(np.float32)
    pfm = b"PF\n8 6\n-1.0\n" + colour[::-1].astype("<f4").tobytes()
    np.testing.assert_array_equal(read(tmp_path / "a.pfm", pfm), colour)
    grey = RGB[..., 0] / 65535
    np.testing.assert_array_equal(read(tmp_path / "a.tif", tiff(grey)), grey)


def test_all_pages_of_64_bits_are_pictures(tmp_path: Path) -> None:
    pages = [np.full((6, 8), 0.1 * i) for i in range(3)]
    (tmp_path / "all.tif").write_bytes(tiff(*pages))
    found = pictures_in(tmp_path / "all.tif")
    assert [each.index for each in found] == [0, 1, 2]
    for picture, page in zip(found, pages, strict=True):
        np.testing.assert_array_equal(load_values(picture), page)


@pytest.mark.parametrize("name", ["a.pfm", "a.tif"])
def test_what_claims_more_than_a_camera_has_is_refused_before_it_is_decoded(
    tmp_path: Path, name: str
) -> None:
    content = bytearray(b"PF\n60000 60000\n-1.0\n" + bytes(96))
    if name == "a.tif":
        content = bytearray(tiff(RGB[..., 0] / 65535))
        at = struct.unpack_from("<I", content, 4)[0] + 2
        struct.pack_into("<HHII", content, at, 256, 4, 1, 60000)
        struct.pack_into("<HHII", content, at + 12, 257, 4, 1, 60000)
    with pytest.raises(StoreError, match="claims 60000 x 60000 px, which no camera has"):
        read(tmp_path / name, bytes(content))


def test_damaged_heads_are_none() -> None:
    whole = tiff(RGB, apart=True)
    assert heads_of(whole, 9) == [Head(8, 6, 16, True)]
    for length in range(len(whole) - 30):
        assert len(heads_of(whole[:length], 9)) <= 1
    circle = bytearray(tiff(RGB[..., 0]))
    (at,) = struct.unpack_from("<I", circle, 4)
    struct.pack_into("<I", circle, at + 2 + 12 * 11, at)
    assert heads_of(bytes(circle), 9) == [Head(8, 6, 16)]
    assert heads_of(b"\x89PNG", 9) == heads_of(b"", 9) == []
