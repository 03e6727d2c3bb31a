"""Files of camera raw become mosaics that are linear in light; what has none is refused with a reason."""

from __future__ import annotations

import builtins
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dsl_core.errors import StoreError
from dsl_core.io.pictures.arrange import picture_files
from dsl_core.io.pictures.camera_raw import bayer_of, read_mosaic
from dsl_core.io.pictures.guess import guess_mapping
from dsl_core.io.pictures.mapping import BlackPicture, StripePictures, WhitePicture
from dsl_core.io.pictures.picture_file import Picture, load_values
from dsl_core.io.pictures.source import open_pictures
from dsl_core.model.captured_code import Stripes
from tests.cases.camera_raw import dng
from tests.cases.foreign_captures import PROJECTOR, frames, write

pytest.importorskip("rawpy", reason="the extra raw is not installed")

MOST_PX = 10_000
MOSAIC = np.random.default_rng(3).integers(512, 16000, (48, 64)).astype(np.uint16)


@pytest.mark.parametrize("bayer", ["RGGB", "BGGR", "GRBG", "GBRG"])
def test_a_mosaic_is_what_was_stored_and_knows_its_colours(bayer: str) -> None:
    content = dng(MOSAIC, bayer)
    assert bayer_of(content, MOST_PX) == bayer
    assert np.abs(read_mosaic(content, MOST_PX) / 65535 - MOSAIC / 16383).max() < 1e-5


def test_what_is_beyond_the_white_level_is_full() -> None:
    found = read_mosaic(dng(MOSAIC, white=12000), MOST_PX)
    assert np.array_equal(found == 65535, MOSAIC >= 12000)


@pytest.mark.parametrize("content", [b"", b"II*\0" + bytes(200), dng(MOSAIC)[:900], dng(MOSAIC)[:-1000]])
def test_damaged_files_are_refused(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "a.nef").write_bytes(content)
    with pytest.raises(StoreError, match=r"a\.nef cannot be read as camera raw \(LibRaw says: .*Convert it"):
        load_values(Picture(tmp_path / "a.nef"))


def test_a_size_that_no_camera_has_is_refused_before_its_pixels_are_read() -> None:
    with pytest.raises(ValueError, match="it claims 64 x 48 px"):
        read_mosaic(dng(MOSAIC), 3000)


def test_without_the_package_it_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "a.dng").write_bytes(dng(MOSAIC))
    before = builtins.__import__

    def lacks(name: str, *more: Any, **named: Any) -> Any:
        if name == "rawpy":
            raise ModuleNotFoundError(name="rawpy")
        return before(name, *more, **named)

    monkeypatch.setattr(builtins, "__import__", lacks)
    with pytest.raises(StoreError, match=r"a\.dng is camera raw\. .*dsl-scan\[raw\].*Convert it to TIFF"):
        load_values(Picture(tmp_path / "a.dng"))


def test_a_capture_of_raw_files_is_guessed_linear_with_their_colours_and_without_their_copies(
    tmp_path: Path,
) -> None:
    pictures, white, black = frames([("columns", Stripes(bits=7))])
    brightest = 0
    for i, picture in enumerate([*pictures, white, black]):
        mosaic = 512 + 60 * picture.astype(np.uint16)
        # Little red light: the mosaic of these pictures alone would be taken for another.
        mosaic[::2, 1::2] = 512 + (mosaic[::2, 1::2] - 512) // 2
        (tmp_path / f"IMG_{i:04d}.CR2").write_bytes(dng(mosaic, "GRBG", white=15872))
        write(tmp_path, {f"IMG_{i:04d}.jpg": picture})
        brightest = max(brightest, int(mosaic.max()))
    assert all(path.suffix == ".CR2" for path in picture_files(tmp_path, ["*"]))
    mapping = guess_mapping(tmp_path, PROJECTOR).mapping
    assert mapping.parts == (StripePictures(bits=7), WhitePicture(), BlackPicture())
    assert (mapping.bayer, mapping.bit_depth, mapping.encoding) == ("GRBG", 16, "linear")
    assert not any("mosaic" in each or "sRGB" in each for each in mapping.unsure)
    scan = open_pictures(tmp_path, mapping)
    assert max(scan.read(shot).max() for shot in scan.plan.shots()) == round(brightest / 15872 * 65535)
