"""Pictures in any format become whole numbers; what is no picture ends in a sentence with its name."""

from __future__ import annotations

import os
import struct
import zlib
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from dsl_core.errors import StoreError
from dsl_core.io.pictures import picture_file
from dsl_core.io.pictures.mapping import Mapping, RawLayout, StripePictures
from dsl_core.io.pictures.picture_file import Picture, load_mosaic, load_values, pictures_in
from dsl_core.optics.colour import srgb_decode
from tests.cases.foreign_captures import write

MAPPING = Mapping(parts=(StripePictures(bits=3),), projector_size_px=(8, 4))
GREY = np.arange(12, dtype=np.uint16).reshape(3, 4) * 20


@pytest.mark.parametrize("ending", ["png", "tif", "bmp", "pgm", "npy"])
def test_every_lossless_format_keeps_its_values(tmp_path: Path, ending: str) -> None:
    write(tmp_path, {f"a.{ending}": GREY})
    assert np.array_equal(load_mosaic(Picture(tmp_path / f"a.{ending}"), MAPPING, 8), GREY)


def test_colour_becomes_grey_or_one_channel(tmp_path: Path) -> None:
    rgb = np.stack([GREY, GREY + 3, GREY + 6], axis=-1)
    np.save(tmp_path / "a.npy", rgb)
    write(tmp_path, {"a.png": rgb[..., ::-1]})
    for name in ("a.npy", "a.png"):
        picture = Picture(tmp_path / name)
        assert np.array_equal(load_mosaic(picture, MAPPING, 8), GREY + 3)
        assert np.array_equal(load_mosaic(picture, MAPPING.model_copy(update={"channel": "red"}), 8), GREY)


@pytest.mark.parametrize(
    ("shape", "is_one"), [((6, 8), True), ((7, 7), False), ((0, 5), False), ((1, 49), False)]
)
def test_a_picture_has_pixels_and_no_more_than_a_camera(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, shape: tuple[int, int], is_one: bool
) -> None:
    monkeypatch.setattr(picture_file, "MOST_PIXELS", 48)
    np.save(tmp_path / "a.npy", np.zeros(shape, np.uint16))
    if is_one:
        assert load_values(Picture(tmp_path / "a.npy")).shape == shape
    else:
        with pytest.raises(StoreError, match=rf"a\.npy is {shape[1]} x {shape[0]} px, which no camera has"):
            load_values(Picture(tmp_path / "a.npy"))


def test_bits_are_moved_to_the_lower_end_and_floats_scaled(tmp_path: Path) -> None:
    write(tmp_path, {"a.tif": GREY << 4}, 12)
    np.save(tmp_path / "f.npy", GREY / 255)
    aligned = MAPPING.model_copy(update={"left_aligned": True})
    assert np.array_equal(load_mosaic(Picture(tmp_path / "a.tif"), aligned, 12), GREY)
    scaled = MAPPING.model_copy(update={"full_scale": 1.0})
    assert np.array_equal(load_mosaic(Picture(tmp_path / "f.npy"), scaled, 8), GREY)
    with pytest.raises(StoreError, match=r"a\.tif holds values up to 3520, more than 8 bits have"):
        load_mosaic(Picture(tmp_path / "a.tif"), MAPPING, 8)


@pytest.mark.parametrize("dtype", [np.float16, np.uint32, np.int64])
def test_values_of_few_and_of_many_bits_are_scaled_by_their_white(tmp_path: Path, dtype: type) -> None:
    """Half-precision numbers end at 65504, and sums of exposures beyond 16 bits."""
    white = 4080.0 if dtype is np.float16 else 2.0**20 - 2.0**12
    np.save(tmp_path / "a.npy", (GREY / 255.0 * white).astype(dtype))
    scaled = MAPPING.model_copy(update={"full_scale": white})
    assert np.abs(load_mosaic(Picture(tmp_path / "a.npy"), scaled, 16) / 257.0 - GREY).max() < 0.1


def test_true_is_white(tmp_path: Path) -> None:
    np.save(tmp_path / "a.npy", GREY > 100)
    assert np.array_equal(load_mosaic(Picture(tmp_path / "a.npy"), MAPPING, 8), np.where(GREY > 100, 255, 0))


def test_one_array_may_hold_all_pictures(tmp_path: Path) -> None:
    wide = np.tile(GREY, 2)
    np.save(tmp_path / "all.npy", np.stack([wide + i for i in range(5)]))
    found = pictures_in(tmp_path / "all.npy")
    assert len(found) == 5
    assert np.array_equal(load_values(found[3]), wide + 3)


def test_raw_pixels_need_their_layout_and_size(tmp_path: Path) -> None:
    (tmp_path / "a.raw").write_bytes(b"head" + GREY.astype(">u2").tobytes())
    layout = RawLayout(width_px=4, height_px=3, header_bytes=4, big_endian=True)
    assert np.array_equal(load_values(Picture(tmp_path / "a.raw"), layout), GREY)
    with pytest.raises(StoreError, match=r"a\.raw holds pixels without their size. State raw"):
        load_values(Picture(tmp_path / "a.raw"))
    with pytest.raises(StoreError, match=r"a\.raw has 28 bytes, 36 are wanted for 4 x 4 px"):
        load_values(Picture(tmp_path / "a.raw"), RawLayout(width_px=4, height_px=4, header_bytes=4))


def test_what_is_no_picture_is_named(tmp_path: Path) -> None:
    (tmp_path / "cut.png").write_bytes(b"\x89PNG\r\n\x1a\n" + b"0" * 40)
    (tmp_path / "empty.bmp").write_bytes(b"")
    (tmp_path / "gone.png").symlink_to(tmp_path / "nowhere.png")
    os.mkfifo(tmp_path / "pipe.png")
    np.save(tmp_path / "text.npy", np.array([["a", "b"]]))
    for name, what in (
        ("cut.png", "cannot be decoded"),
        ("empty.bmp", "cannot be decoded"),
        ("gone.png", "a link to a file that does not exist"),
        ("pipe.png", "it is a pipe or a device"),
        ("text.npy", "does not hold numbers"),
    ):
        with pytest.raises(StoreError, match=rf"{name}.*{what}"):
            load_values(Picture(tmp_path / name))


def test_a_small_file_that_claims_a_huge_picture_is_refused_before_it_is_decoded(tmp_path: Path) -> None:
    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    head = struct.pack(">IIBBBBB", 60000, 60000, 8, 0, 0, 0, 0)
    data = b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", b"") + chunk(b"IEND", b"")
    (tmp_path / "bomb.png").write_bytes(data)
    with pytest.raises(StoreError, match=r"bomb\.png claims .*camera has"):
        load_values(Picture(tmp_path / "bomb.png"))


def test_pages_of_a_tiff_are_pictures_but_a_preview_is_none(tmp_path: Path) -> None:
    from PIL import Image

    pages = [np.full((6, 8), 40 * k, np.uint16) for k in range(5)]
    first, *others = [Image.fromarray(page) for page in pages]
    first.save(tmp_path / "all.tiff", save_all=True, append_images=others)
    found = pictures_in(tmp_path / "all.tiff")
    assert [picture.index for picture in found] == [0, 1, 2, 3, 4]
    for picture, page in zip(found, pages, strict=True):
        np.testing.assert_array_equal(load_values(picture), page)
    preview = Image.fromarray(pages[1][:3, :4])
    first.save(tmp_path / "one.tif", save_all=True, append_images=[preview])
    assert pictures_in(tmp_path / "one.tif") == [Picture(tmp_path / "one.tif")]


@pytest.mark.parametrize(("full_scale", "most"), [(None, 1.0), (1.0, 1.0), (255.0, 255.0)])
def test_floats_for_screens_run_to_one_unless_their_end_is_stated(
    tmp_path: Path, full_scale: float | None, most: float
) -> None:
    np.save(tmp_path / "f.npy", np.array([[0.0, 1.0], [0.5, 1.0]]) * most)
    mapping = MAPPING.model_copy(update={"encoding": "srgb", "full_scale": full_scale, "bit_depth": 8})
    frame = load_mosaic(Picture(tmp_path / "f.npy"), mapping, 16)
    assert frame[0].tolist() == [0, 65535]
    assert frame[1, 0] == pytest.approx(65535 * float(srgb_decode(np.array([128 / 255]))[0]), abs=1)


def _dark_subtracted(noise: float) -> NDArray[np.float64]:
    """A picture from black to white (1) with noise, a share of white."""
    light = np.linspace(0, 1, 4000).reshape(40, 100)
    return np.asarray(light + np.random.default_rng(2).normal(0, noise, light.shape))


@pytest.mark.parametrize("kind", [np.float32, np.int16])
def test_noise_below_a_subtracted_dark_picture_is_black(tmp_path: Path, kind: type[np.generic]) -> None:
    values = _dark_subtracted(0.012)
    assert values.min() < -0.02
    np.save(tmp_path / "a.npy", np.rint(values * 3000).astype(kind))
    frame = load_mosaic(Picture(tmp_path / "a.npy"), MAPPING, 12)
    assert np.array_equal(frame, np.rint(values.clip(0) * 3000))
    np.save(tmp_path / "f.npy", values.astype(np.float32))
    scaled = MAPPING.model_copy(update={"full_scale": 1.1})
    frame = load_mosaic(Picture(tmp_path / "f.npy"), scaled, 12)
    assert np.abs(frame - np.rint(values.clip(0) / 1.1 * 4095)).max() <= 1


@pytest.mark.parametrize(
    "values",
    [
        pytest.param(_dark_subtracted(0.012) - 0.5, id="difference of pictures"),
        pytest.param(np.where(_dark_subtracted(0) > 0.9, -0.15, 0.5), id="ran over"),
        pytest.param(_dark_subtracted(0.001) - 0.08, id="too much subtracted"),
    ],
)
def test_values_far_below_zero_ask_for_an_offset(tmp_path: Path, values: NDArray[np.float64]) -> None:
    np.save(tmp_path / "a.npy", np.rint(values * 3000).astype(np.int16))
    with pytest.raises(StoreError, match=r"further below 0 than noise gets\. Add one offset to all pictures"):
        load_mosaic(Picture(tmp_path / "a.npy"), MAPPING, 12)
