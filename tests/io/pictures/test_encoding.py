"""Pictures for screens are found out by their code, decoded when stated, and named when nothing tells."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image, PngImagePlugin
from scipy.ndimage import uniform_filter1d

from dsl_core.io.pictures.encoding import encoding_of, noted_encoding
from dsl_core.io.pictures.guess import guess_mapping
from dsl_core.io.pictures.mapping import BlackPicture, Mapping, StripePictures, WhitePicture
from dsl_core.io.pictures.picture_file import Picture, load_mosaic
from dsl_core.io.pictures.source import open_pictures
from dsl_core.model.captured_code import Stripes
from dsl_core.optics.colour import srgb_decode, srgb_encode
from tests.cases.foreign_captures import PROJECTOR, blurred, for_screens, frames, write

MAPPING = Mapping(parts=(StripePictures(bits=7), WhitePicture(), BlackPicture()), projector_size_px=PROJECTOR)


@pytest.fixture(scope="module")
def folders(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """One capture with linear values and with those of sRGB."""
    pictures, white, black = frames([("columns", Stripes(bits=7))])
    root, made = tmp_path_factory.mktemp("encoded"), {}
    for name, change in (("linear", blurred), ("srgb", for_screens)):
        named = {f"{i:02d}.png": change(p) for i, p in enumerate([*pictures, white, black])}
        made[name] = write(root / name, named)
    return made


@pytest.mark.parametrize(
    ("stored", "stated", "verdict", "advice"),
    [
        ("linear", "linear", "linear", ""),
        ("srgb", "srgb", "linear", ""),
        ("srgb", "linear", "srgb", "set encoding of the mapping to srgb"),
        ("linear", "srgb", "darker", "set encoding of the mapping to linear, which the files seem"),
    ],
)
def test_what_is_stated_is_compared_with_the_sums_of_the_code(
    folders: dict[str, Path], stored: str, stated: str, verdict: str, advice: str
) -> None:
    mapping = MAPPING.model_copy(update={"encoding": stated})
    found, said = encoding_of(open_pictures(folders[stored], mapping))
    assert found.verdict == verdict
    assert said.startswith(advice)
    assert bool(said) == bool(advice)


@pytest.mark.slow
def test_a_guess_decodes_pictures_for_screens_and_says_so(folders: dict[str, Path]) -> None:
    guessed = guess_mapping(folders["srgb"], PROJECTOR).mapping
    assert guessed.encoding == "srgb"
    assert any("brighter than white and black together" in each for each in guessed.unsure)
    assert guess_mapping(folders["linear"], PROJECTOR).mapping.encoding == "linear"
    stated = guess_mapping(folders["srgb"], PROJECTOR, encoding="linear").mapping
    assert stated.encoding == "linear"
    assert not any("white and black" in each for each in stated.unsure)


@pytest.mark.parametrize("stored", ["linear", "srgb"])
def test_stripes_without_inverse_tell_pictures_for_screens_by_their_mean(stored: str, tmp_path: Path) -> None:
    pictures, white, black = frames([("columns", Stripes(bits=7, inverse=False))])
    change = for_screens if stored == "srgb" else blurred
    write(tmp_path, {f"{i:02d}.png": change(p) for i, p in enumerate([*pictures, white, black])})
    guessed = guess_mapping(tmp_path, PROJECTOR).mapping
    assert guessed.encoding == stored
    assert any("fine stripes are, on average" in each for each in guessed.unsure) == (stored == "srgb")
    found, _ = encoding_of(open_pictures(tmp_path, guessed))
    assert found.verdict == "linear"


def test_stripes_that_a_lens_blurs_are_no_odd_pair_of_a_screens_pictures(tmp_path: Path) -> None:
    """Where stripes of two projector pixels are finer than the camera's, sums are bright everywhere."""
    pictures, white, black = frames([("columns", Stripes(bits=7))], camera=(64, 48))
    small = [uniform_filter1d(each.astype(float), 3, axis=1) / 255 for each in (*pictures, white, black)]
    stored = {
        f"{i:02d}.png": np.rint(255 * srgb_encode(each)).astype(np.uint8) for i, each in enumerate(small)
    }
    guessed = guess_mapping(write(tmp_path / "right", stored), PROJECTOR).mapping
    assert guessed.parts == MAPPING.parts
    assert guessed.encoding == "srgb"
    assert not any("should be a pattern and its inverse" in each for each in guessed.unsure)
    wrong = {**stored, "11.png": stored["06.png"]}
    guessed = guess_mapping(write(tmp_path / "wrong", wrong), PROJECTOR).mapping
    assert any("10.png and 11.png should be a pattern and its inverse" in each for each in guessed.unsure)


def test_values_for_screens_become_linear_channel_by_channel(tmp_path: Path) -> None:
    colours = np.zeros((4, 6, 3), np.uint8)
    colours[:] = (255, 128, 0)
    Image.fromarray(colours).save(tmp_path / "a.png")
    mapping = MAPPING.model_copy(update={"encoding": "srgb"})
    frame = load_mosaic(Picture(tmp_path / "a.png"), mapping, 16)
    light = (1 + float(srgb_decode(np.array([128 / 255]))[0])) / 3
    assert frame[0, 0] == pytest.approx(light * 65535, abs=1)
    green = mapping.model_copy(update={"channel": "green"})
    assert load_mosaic(Picture(tmp_path / "a.png"), green, 16)[0, 0] == pytest.approx(14146, abs=2)


def test_files_that_note_their_encoding_are_named_where_no_stripes_tell(tmp_path: Path) -> None:
    pictures, white, black = frames([("columns", Stripes(bits=3, unit_px=16, inverse=False))])
    noted = PngImagePlugin.PngInfo()
    noted.add(b"sRGB", b"\0")
    for index, picture in enumerate([*pictures, white, black]):
        Image.fromarray(picture.astype(np.uint8)).save(tmp_path / f"{index:02d}.png", pnginfo=noted)
    parts = (StripePictures(bits=3, unit_px=16, inverse="none"), WhitePicture(), BlackPicture())
    mapping = Mapping(parts=parts, projector_size_px=PROJECTOR)
    found, said = encoding_of(open_pictures(tmp_path, mapping))
    assert found.verdict == "unknown"
    assert said.startswith("the files note sRGB, and too few pixels see bright and dark stripes")
    Image.fromarray(white.astype(np.uint8)).save(tmp_path / "plain.png")
    Image.fromarray(white.astype(np.uint8)).save(tmp_path / "a.jpg")
    assert noted_encoding(tmp_path / "plain.png") == ""
    assert noted_encoding(tmp_path / "a.jpg").startswith("JPEG")
    assert noted_encoding(tmp_path / "none.png") == ""
