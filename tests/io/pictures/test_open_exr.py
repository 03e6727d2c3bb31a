"""Pictures in OpenEXR are read as their camera saw them, whatever layers and windows their renderer wrote."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR
import pytest
from numpy.typing import NDArray

from dsl_core.errors import StoreError
from dsl_core.io.pictures import open_exr
from dsl_core.io.pictures.mapping import Mapping, StripePictures
from dsl_core.io.pictures.open_exr import read_exr
from dsl_core.io.pictures.picture_file import Picture, load_mosaic, load_values

GREY = np.arange(20, dtype=np.float32).reshape(4, 5) / 20
COLOUR = np.stack([GREY, GREY * 2, GREY * 3], -1).astype(np.float32)
DEPTH = np.full((4, 5), 700, np.float32)


def _colours(prefix: str = "", factor: float = 1) -> dict[str, NDArray[np.float32]]:
    scaled = (factor * COLOUR).astype(np.float32)
    return {f"{prefix}{name}": scaled[..., at].copy() for at, name in enumerate("RGB")}


def _write(path: Path, channels: dict[str, NDArray[Any]], **head: Any) -> Path:
    OpenEXR.File({"type": OpenEXR.scanlineimage, **head}, channels).write(str(path))
    return path


@pytest.mark.parametrize(
    ("channels", "wanted"),
    [
        (_colours(), COLOUR),
        ({**_colours(), "A": DEPTH, "Z": DEPTH, "normal.X": DEPTH}, COLOUR),
        ({**_colours("diffuse.", 9), **_colours("ViewLayer.Combined."), "ViewLayer.Depth.Z": DEPTH}, COLOUR),
        ({"Y": GREY, "Z": DEPTH}, GREY),
        ({"cam0.Y": GREY.astype(np.float16)}, GREY.astype(np.float16)),
        ({"radiance": GREY}, GREY),
    ],
)
def test_what_the_camera_saw_is_found_among_layers(
    tmp_path: Path, channels: dict[str, NDArray[Any]], wanted: NDArray[np.float32]
) -> None:
    path = _write(tmp_path / "a.exr", channels)
    np.testing.assert_array_equal(read_exr(path, 100), wanted)
    np.testing.assert_array_equal(load_values(Picture(path)), wanted)


@pytest.mark.parametrize("at", [(2, 1), (0, 0), (-1, -2), (6, 4)])
def test_what_a_file_leaves_out_at_its_edges_is_black(tmp_path: Path, at: tuple[int, int]) -> None:
    left, top = at
    windows = {
        "dataWindow": (np.array([left, top], np.int32), np.array([left + 4, top + 3], np.int32)),
        "displayWindow": (np.array([0, 0], np.int32), np.array([8, 5], np.int32)),
    }
    found = read_exr(_write(tmp_path / "a.exr", {"Y": GREY + 1}, **windows), 100)
    wanted = np.zeros((12, 15), np.float32)
    wanted[2 + top : 6 + top, 2 + left : 7 + left] = GREY + 1
    np.testing.assert_array_equal(found, wanted[2:8, 2:11])


def test_the_part_with_the_picture_is_chosen(tmp_path: Path) -> None:
    parts = [
        OpenEXR.Part({"name": "depth"}, {"depth.Z": DEPTH}),
        OpenEXR.Part({"name": "seen"}, {"RGB": COLOUR}),
    ]
    OpenEXR.File(parts).write(str(tmp_path / "a.exr"))
    np.testing.assert_array_equal(read_exr(tmp_path / "a.exr", 100), COLOUR)


@pytest.mark.parametrize(
    ("channels", "why"),
    [
        ({"Z": DEPTH}, "no channels R, G and B, nor Y; its channels are Z"),
        ({"normal.X": DEPTH, "normal.Y2": DEPTH}, "its channels are normal.X, normal.Y2"),
    ],
)
def test_what_no_camera_sees_is_refused(
    tmp_path: Path, channels: dict[str, NDArray[np.float32]], why: str
) -> None:
    path = _write(tmp_path / "a.exr", channels)
    with pytest.raises(StoreError, match=rf"a\.exr cannot be read as OpenEXR \(it has .*{why}"):
        load_values(Picture(path))


def test_what_is_damaged_too_large_or_not_a_file_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = _write(tmp_path / "a.exr", _colours())
    with pytest.raises(ValueError, match="claims 5 x 4 px"):
        read_exr(path, 19)
    monkeypatch.setattr(open_exr, "_MOST_VALUES", 59)
    with pytest.raises(ValueError, match="larger than those"):
        read_exr(path, 20)
    monkeypatch.undo()
    (tmp_path / "cut.exr").write_bytes(path.read_bytes()[:-30])
    (tmp_path / "text.exr").write_text("not a picture")
    for name in ("cut", "text"):
        with pytest.raises(StoreError, match=rf"{name}\.exr cannot be read as OpenEXR"):
            load_values(Picture(tmp_path / f"{name}.exr"))
    (tmp_path / "folder.exr").mkdir()
    with pytest.raises(StoreError, match="it is a folder"):
        load_values(Picture(tmp_path / "folder.exr"))


def test_sparks_become_white_and_what_a_filter_left_below_zero_black(tmp_path: Path) -> None:
    values = np.full((50, 50), 0.5, np.float32)
    values[3, 4], values[5, 6], values[7, 8] = 40.0, np.inf, -0.01
    mapping = Mapping(parts=(StripePictures(bits=3),), projector_size_px=(8, 4), full_scale=1.0)
    frame = load_mosaic(Picture(_write(tmp_path / "a.exr", {"Y": values})), mapping, 16)
    assert [frame[3, 4], frame[5, 6], frame[7, 8], frame[0, 0]] == [65535, 65535, 0, 32768]
    values[:4] = 2.0
    with pytest.raises(StoreError, match="State full_scale"):
        load_mosaic(Picture(_write(tmp_path / "b.exr", {"Y": values})), mapping, 16)
