"""TIFF that OpenCV does not decode is read by Pillow, where that keeps its values."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from dsl_core.errors import StoreError
from dsl_core.io.pictures.picture_file import Picture, load_values, pictures_in

RNG = np.random.default_rng(2)
GREY, WIDE = RNG.integers(0, 255, (9, 11), np.uint8), RNG.integers(0, 65535, (9, 11), np.uint16)
COLOUR = RNG.integers(0, 255, (9, 11, 3), np.uint8)


@pytest.mark.parametrize("compression", ["zstd", "lzma", "tiff_lzw"])
@pytest.mark.parametrize("values", [GREY, WIDE, COLOUR, WIDE.astype(np.float32)])
def test_compressions_that_opencv_lacks_are_read(
    tmp_path: Path, compression: str, values: np.ndarray, capfd: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "a.tif"
    Image.fromarray(values).save(path, compression=compression)
    found = load_values(Picture(path))
    np.testing.assert_array_equal(found, values)
    assert found.dtype == values.dtype
    assert capfd.readouterr().err == ""


def test_pages_of_such_a_file_are_read(tmp_path: Path) -> None:
    path = tmp_path / "a.tif"
    pages = [Image.fromarray(np.roll(WIDE, k)) for k in range(3)]
    pages[0].save(path, compression="zstd", save_all=True, append_images=pages[1:])
    found = pictures_in(path)
    assert len(found) == 3
    for k, each in enumerate(found):
        np.testing.assert_array_equal(load_values(each), np.roll(WIDE, k))


def test_what_nothing_decodes_is_not_only_called_damaged(tmp_path: Path) -> None:
    path = tmp_path / "a.tif"
    Image.fromarray(GREY).save(path, compression="zstd")
    content = bytearray(path.read_bytes())
    content[len(content) // 2 :] = b""
    path.write_bytes(bytes(content))
    with pytest.raises(StoreError, match="it is damaged, or of a kind that is not read"):
        load_values(Picture(path))


def test_values_that_are_no_numbers_are_named(tmp_path: Path) -> None:
    values = GREY.astype(np.float32)
    values[2, 3:5] = np.nan
    np.save(tmp_path / "a.npy", values)
    with pytest.raises(StoreError, match=r"a\.npy holds NaN in place of 2 of its values"):
        load_values(Picture(tmp_path / "a.npy"))
