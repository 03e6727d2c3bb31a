"""Pictures that go against the mapping that arranges them are named, or refused where all are shifted."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from dsl_core.errors import StoreError
from dsl_core.io.pictures.mapped_doubts import doubts_of_mapping
from dsl_core.io.pictures.mapping import Mapping, StripePictures
from dsl_core.io.pictures.source import open_pictures
from dsl_core.model.captured_code import CapturedCode, Stripes
from dsl_core.patterns.captured_code import captured_levels
from dsl_core.workflows.captures import import_pictures
from tests.cases.foreign_captures import CAMERA, PROJECTOR, for_screens, frames, scene, write

Pictures = list[NDArray[np.uint16]]
MAPPING = Mapping(
    parts=(StripePictures(bits=7), StripePictures(bits=7, axis="rows")), projector_size_px=PROJECTOR
)


@pytest.fixture(scope="module")
def both_axes() -> Pictures:
    """Columns, then rows, each digit with its inverse."""
    return frames([("columns", Stripes(bits=7)), ("rows", Stripes(bits=7))])[0]


def _named(pictures: Pictures) -> dict[str, NDArray[np.uint16]]:
    return {f"{i:02}.png": each for i, each in enumerate(pictures)}


def _doubts(folder: Path, mapping: Mapping = MAPPING) -> list[str]:
    return doubts_of_mapping(open_pictures(folder, mapping))


def test_a_missing_picture_and_a_stray_one_do_not_shift_the_others_without_a_word(
    tmp_path: Path, both_axes: Pictures
) -> None:
    named = _named(both_axes)
    del named["05.png"]
    folder = write(tmp_path / "set", named | {"dark.png": np.full_like(both_axes[0], 8)})
    with pytest.raises(
        StoreError,
        match=r"dark.png and 00.png are .* nor are 2 of the other 13 pairs.* from 04.png to 06.png",
    ) as caught:
        _doubts(folder)
    assert "correct files, parts or missing" in str(caught.value)
    with pytest.raises(StoreError, match="a pattern and its inverse, but they are not"):
        import_pictures(folder, tmp_path / "a.dsl", MAPPING)
    assert not (tmp_path / "a.dsl").exists()


@pytest.mark.parametrize("encoded", [False, True])
def test_pictures_of_their_mapping_leave_no_doubt(tmp_path: Path, both_axes: Pictures, encoded: bool) -> None:
    pictures = [for_screens(each) for each in both_axes] if encoded else both_axes
    assert _doubts(write(tmp_path, _named(pictures))) == []


def _of_a_small_object(side: float, brightness: float) -> Pictures:
    """The same patterns on a square of a share of the picture's width and height, all else unlit."""
    x, y = np.meshgrid(np.arange(CAMERA[0]) / CAMERA[0], np.arange(CAMERA[1]) / CAMERA[1])
    square = (np.abs(x - 0.5) < side / 2) & (np.abs(y - 0.5) < side / 2)
    seen = replace(scene(), albedo=np.where(square, brightness, 0.0))
    stripes = Stripes(bits=7)
    codes = CapturedCode(column_sets=(stripes,)), CapturedCode(row_sets=(stripes,))
    levels = [captured_levels(code, PROJECTOR, i) for code in codes for i in range(stripes.frame_count)]
    return [seen.picture(each, 7 * i, noise=0.01) for i, each in enumerate(levels)]


@pytest.mark.parametrize(("side", "brightness"), [(0.3, 0.8), (0.15, 0.8), (0.35, 0.2), (0.2, 0.2)])
def test_the_noise_around_a_small_object_is_not_judged(
    tmp_path: Path, side: float, brightness: float
) -> None:
    pictures = _of_a_small_object(side, brightness)
    assert _doubts(write(tmp_path / "right", _named(pictures))) == []
    with pytest.raises(StoreError, match="a pattern and its inverse, but they are not"):
        _doubts(write(tmp_path / "shifted", _named([*pictures[1:], pictures[0]])))


def test_one_picture_in_another_s_place_is_named_and_imported(tmp_path: Path, both_axes: Pictures) -> None:
    folder = write(tmp_path / "set", _named([*both_axes[:5], both_axes[0], *both_axes[6:]]))
    (doubt,) = _doubts(folder)
    assert doubt.startswith("04.png and 05.png should be a pattern and its inverse")
    import_pictures(folder, tmp_path / "a.dsl", MAPPING)
    told = MAPPING.model_copy(update={"unsure": (doubt,)})
    assert _doubts(folder, told) == []


def test_numbers_that_jump_are_said_where_no_inverse_tells(tmp_path: Path, both_axes: Pictures) -> None:
    named = _named(both_axes[0:14:2])
    del named["03.png"]
    folder = write(tmp_path, named | {"dark.png": np.full_like(both_axes[0], 8)})
    mapping = Mapping(parts=(StripePictures(bits=7, inverse="none"),), projector_size_px=PROJECTOR)
    (doubt,) = _doubts(folder, mapping)
    assert "jump from 02.png to 04.png" in doubt
