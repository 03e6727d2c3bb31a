"""A folder of a stranger is taken in by what its pictures show; what that leaves open is said."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import OpenEXR
import pytest
import scipy.io
from numpy.typing import NDArray

from dsl_core.errors import StoreError
from dsl_core.io.pictures.candidates import Candidate
from dsl_core.io.pictures.guess import (
    AS_ENCODED,
    _alike_next,
    _recognised,
    guess_mapping,
)
from dsl_core.io.pictures.look import _bayer_of, _depth_of
from dsl_core.io.pictures.mapping import BlackPicture, PhasePictures, StripePictures, WhitePicture
from dsl_core.model.captured_code import Phases, Stripes
from tests.cases.foreign_captures import PROJECTOR, frames, write

Pictures = list[NDArray[np.uint16]]


@pytest.fixture(scope="module")
def gray() -> Pictures:
    """Columns with inverse, then white and black."""
    pictures, white, black = frames([("columns", Stripes(bits=7))])
    return [*pictures, white, black]


def test_the_mapping_finds_its_files_and_says_what_they_are(tmp_path: Path, gray: Pictures) -> None:
    folder = write(tmp_path / "scan", {f"im{i + 1}.bmp": p for i, p in enumerate(gray)})
    guess = guess_mapping(folder)
    assert guess.mapping.files == ("*",)
    assert guess.mapping.parts == (StripePictures(bits=7), WhitePicture(), BlackPicture())
    assert guess.table[0] == ("im1.bmp", "columns, gray bit 6")
    assert guess.table[-1] == ("im16.bmp", "black")
    assert guess.mapping.projector_size_px == (128, 96)
    assert any("7 bits of columns up to 12" in sentence for sentence in guess.mapping.unsure)


@pytest.mark.parametrize("period_px", [16.0, 8.0])
def test_sinusoids_of_a_mirrored_picture_rise_with_the_numbers_of_their_stripes(
    tmp_path: Path, period_px: float
) -> None:
    sets: list[tuple[str, Stripes | Phases]] = [("columns", Stripes(bits=7, inverse=False))]
    sets += [("columns", Phases(periods_px=(period_px,), steps=4, start_deg=90))]
    pictures, white, black = frames(sets)
    mirrored = {f"{i:02}.png": each[:, ::-1] for i, each in enumerate([*pictures, white, black])}
    mapping = guess_mapping(write(tmp_path, mirrored), PROJECTOR).mapping
    assert mapping.parts[:2] == (
        StripePictures(bits=7, inverse="none"),
        PhasePictures(fringes=(128 / period_px,), steps=4, start_deg=90.0, direction=1),
    )
    assert any("columns fall along the picture" in sentence for sentence in mapping.unsure)


@pytest.mark.slow
def test_one_of_two_cameras_is_taken_and_the_other_named(tmp_path: Path, gray: Pictures) -> None:
    pictures = {f"cam{c}_{i:02d}.png": p for c in (1, 2) for i, p in enumerate(gray)}
    folder = write(tmp_path, pictures)
    guess = guess_mapping(folder, PROJECTOR)
    assert guess.mapping.files == ("cam1_*.png",)
    assert guess.others == ("cam2",)
    assert guess_mapping(folder, PROJECTOR, "cam2").mapping.files == ("cam2_*.png",)
    with pytest.raises(StoreError, match="no set 'left'; found were: cam1, cam2"):
        guess_mapping(folder, PROJECTOR, "left")


def test_a_picture_with_the_lens_covered_is_no_inverse_of_the_black_one(
    tmp_path: Path, gray: Pictures
) -> None:
    dark = np.asarray(np.random.default_rng(3).normal(1, 0.6, gray[0].shape).clip(0, 9).round(), np.uint16)
    rows = frames([("rows", Stripes(bits=7))])[0]
    pictures = {f"pattern_{i:02}.png": p for i, p in enumerate([*gray[:14], *rows])}
    pictures |= {"white.png": gray[14], "black.png": gray[15], "dark.png": dark}
    mapping = guess_mapping(write(tmp_path, pictures), PROJECTOR).mapping
    assert [part.kind for part in mapping.parts] == ["black", "stripes", "stripes", "white"]
    assert mapping.parts[1] == StripePictures(bits=7)
    assert "dark.png" not in mapping.files
    assert mapping.unsure == ("1 picture does not belong to the code and is not used",)


def test_lights_and_axes_may_be_in_folders_of_their_own(tmp_path: Path, gray: Pictures) -> None:
    pictures = {f"v/{i}.png": p for i, p in enumerate(gray[:14])} | {"w.png": gray[14], "b.png": gray[15]}
    guess = guess_mapping(write(tmp_path, pictures), PROJECTOR)
    assert guess.mapping.files == ("*", "*/*")
    assert [part.kind for part in guess.mapping.parts] == ["black", "white", "stripes"]


def test_pictures_of_a_renderer_are_linear_and_their_sparks_are_not_white(
    tmp_path: Path, gray: Pictures
) -> None:
    for index, each in enumerate(gray):
        values = each.astype(np.float32) / 7
        values[3 + index, 4] = 9000
        OpenEXR.File({}, {"Combined.RGB": np.stack([values] * 3, -1)}).write(
            str(tmp_path / f"{index:02}.exr")
        )
    mapping = guess_mapping(tmp_path, PROJECTOR).mapping
    assert mapping.parts == (StripePictures(bits=7), WhitePicture(), BlackPicture())
    assert mapping.encoding == "linear"
    assert mapping.bit_depth == 16
    assert mapping.full_scale is not None
    assert max(each.max() for each in gray) / 7 < mapping.full_scale < 100


def test_an_absent_number_is_seen(tmp_path: Path, gray: Pictures) -> None:
    folder = write(tmp_path, {f"im{i}.png": p for i, p in enumerate(gray) if i != 5})
    mapping = guess_mapping(folder, PROJECTOR).mapping
    assert mapping.missing == (5,)
    assert any("1 picture is absent" in sentence for sentence in mapping.unsure)


def test_a_preview_among_the_pictures_is_no_light_of_the_code(tmp_path: Path, gray: Pictures) -> None:
    named = {f"im{i:02d}.png": each for i, each in enumerate(gray)}
    guess = guess_mapping(write(tmp_path, {**named, "preview.png": gray[14]}), PROJECTOR)
    assert guess.table[-1] == ("im15.png", "black")
    assert guess.mapping.unsure == ("1 picture does not belong to the code and is not used",)


def test_white_and_black_are_no_finest_digit(tmp_path: Path, gray: Pictures) -> None:
    named = {f"im{i:02d}.png": each for i, each in enumerate([*gray, gray[14]])}
    mapping = guess_mapping(write(tmp_path, named), PROJECTOR).mapping
    stripes = [part for part in mapping.parts if isinstance(part, StripePictures)]
    assert [part.bits for part in stripes] == [7]


def test_numbers_that_jump_are_told(tmp_path: Path, gray: Pictures) -> None:
    numbers = [*range(14), 60, 61]
    named = {f"im{i:02d}.png": p for i, p in zip(numbers, gray, strict=True)}
    told = guess_mapping(write(tmp_path, named), PROJECTOR).mapping.unsure
    assert len(told) == 1
    assert told[0].startswith("the numbers of the names jump from im13.png to im60.png")


def test_bit_depth_and_alignment_are_read_from_the_values(tmp_path: Path) -> None:
    pictures, white, black = frames([("columns", Stripes(bits=7, inverse=False))], 12)
    named = {f"{i}.tif": p << 4 for i, p in enumerate([white, black, *pictures])}
    mapping = guess_mapping(write(tmp_path, named, 12), PROJECTOR).mapping
    assert (mapping.bit_depth, mapping.left_aligned) == (12, True)


def test_where_values_end_below_their_bits_is_told(tmp_path: Path, gray: Pictures) -> None:
    values = [np.minimum(p.astype(float) * 1.6 * 64, 16383).astype(np.uint16) for p in gray]
    noise = np.random.default_rng(4)
    named = {
        f"{i:02d}.png": np.minimum(p + noise.integers(0, 64, p.shape), 16383).astype(np.uint16)
        for i, p in enumerate(values)
    }
    mapping = guess_mapping(write(tmp_path, named, 16), PROJECTOR).mapping
    assert (mapping.bit_depth, mapping.full_scale) == (16, 16383.0)
    assert any("values end at 16383: pixels that reach it" in each for each in mapping.unsure)


def test_stripes_count_the_periods_of_a_sinusoid(tmp_path: Path) -> None:
    sets: list[tuple[str, Stripes | Phases]] = [
        ("columns", Stripes(bits=4, inverse=False, unit_px=8)),
        ("columns", Phases(periods_px=(16.0,), steps=4, start_deg=-90)),
    ]
    pictures, white, black = frames(sets)
    mapping = guess_mapping(
        write(tmp_path, {f"{i}.png": p for i, p in enumerate([white, black, *pictures])}), PROJECTOR
    ).mapping
    stripes, phases = mapping.parts[2:]
    assert isinstance(stripes, StripePictures)
    assert isinstance(phases, PhasePictures)
    assert stripes.unit_px == 8
    assert (phases.fringes, phases.start_deg) == ((8.0,), -90.0)


@pytest.mark.slow
def test_stripes_count_the_periods_of_every_sinusoid(tmp_path: Path) -> None:
    sets: list[tuple[str, Stripes | Phases]] = [
        ("columns", Stripes(bits=4, inverse=False, unit_px=8)),
        ("columns", Phases(periods_px=(32.0, 16.0), steps=4)),
    ]
    pictures, white, black = frames(sets)
    named = {f"{i}.png": p for i, p in enumerate([white, black, *pictures])}
    phases = guess_mapping(write(tmp_path, named), PROJECTOR).mapping.parts[3]
    assert isinstance(phases, PhasePictures)
    assert phases.fringes == (4.0, 8.0)


def test_folders_of_no_capture_end_in_a_sentence(tmp_path: Path) -> None:
    empty = tmp_path / "empty"
    empty.mkdir()
    with pytest.raises(StoreError, match=r"contains 0 pictures .*state raw in a mapping"):
        guess_mapping(empty)
    with pytest.raises(StoreError, match="is not a folder"):
        guess_mapping(tmp_path / "nowhere")
    rng = np.random.default_rng(5)
    holiday = {f"{i}.png": rng.integers(0, 255, (30, 40), np.uint16) for i in range(8)}
    with pytest.raises(StoreError, match="make no sense as a capture"):
        guess_mapping(write(tmp_path / "holiday", holiday))
    dark = {f"{i}.png": np.full((30, 40), 20, np.uint16) for i in range(8)}
    with pytest.raises(StoreError, match="no projector's light is seen"):
        guess_mapping(write(tmp_path / "dark", dark))
    sizes = {f"{i}.png": np.zeros((30, 40 + i), np.uint16) for i in range(8)}
    with pytest.raises(StoreError, match=r"1\.png is 41 x 30 px, the first picture 40 x 30"):
        guess_mapping(write(tmp_path / "sizes", sizes))


@pytest.mark.parametrize(
    ("bits", "most", "is_wide", "floats", "found"),
    [
        (0xFF, 255, False, False, (None, False)), (0x3FF, 1023, True, False, (10, False)),
        (0xFFF, 1024, True, False, (12, False)), (0xFFF, 4095, True, False, (12, False)),
        (0xFFC0, 0xFFC0, True, False, (10, True)), (0xFFF0, 0xFFF0, True, False, (12, True)),
        (0x1FFF, 4096, True, False, (16, False)), (0xFFF8, 0xFFF8, True, False, (16, False)),
        (0, 1.0, False, True, (16, False)),
    ],
)  # fmt: skip
def test_the_depth_of_pictures_is_told_by_the_bits_that_occur(
    bits: int, most: float, is_wide: bool, floats: bool, found: tuple[int | None, bool]
) -> None:
    assert _depth_of(bits, most, is_wide, floats) == found


@pytest.mark.parametrize(
    ("cells", "bayer"),
    [
        ([[50, 100], [100, 60]], "RGGB"), ([[100, 50], [60, 100]], "GRBG"), ([[100, 100], [104, 111]], None),
        ([[100, 100], [104, 113]], "RGGB"), ([[50, 100], [106, 60]], None), ([[50, 100], [104, 60]], "RGGB"),
        ([[0, 100], [100, 60]], None), ([[100, 50], [55, 104]], "GRBG"),
    ],
)  # fmt: skip
def test_a_mosaic_has_two_like_greens_and_unlike_neighbours(
    cells: list[list[int]], bayer: str | None
) -> None:
    assert _bayer_of(np.tile(np.array(cells, np.float32), (4, 6))) == bayer


def test_names_with_the_time_of_day_are_one_capture(tmp_path: Path, gray: Pictures) -> None:
    named = {f"Image__12-{33 + (i + 52) // 60}-{(i + 52) % 60:02d}.png": p for i, p in enumerate(gray)}
    mapping = guess_mapping(write(tmp_path, named), PROJECTOR).mapping
    assert mapping.files == ("*",)
    assert mapping.parts == (StripePictures(bits=7), WhitePicture(), BlackPicture())


def test_inverses_may_be_in_a_folder_of_their_own(tmp_path: Path, gray: Pictures) -> None:
    sides = {0: "normal", 1: "turned"}
    named = {f"{sides[i % 2]}/{i // 2}.png": p for i, p in enumerate(gray[:14])}
    guess = guess_mapping(write(tmp_path, named), PROJECTOR)
    assert guess.mapping.parts == (StripePictures(bits=7, inverse="after"),)
    assert not guess.others


@pytest.mark.slow
def test_an_array_whose_last_axis_counts_pictures_is_told(tmp_path: Path, gray: Pictures) -> None:
    np.save(tmp_path / "all.npy", np.stack(gray, -1)[:32, :40].astype(np.uint8))
    with pytest.raises(StoreError, match=r"all\.npy is taken for 32 pictures of 16 x 40 px; .*moveaxis"):
        guess_mapping(tmp_path, PROJECTOR)


def test_an_array_of_matlab_whose_first_axis_counts_pictures_is_told(tmp_path: Path, gray: Pictures) -> None:
    stack = np.stack(gray)[:, :32, :40].astype(np.uint8)
    scipy.io.savemat(tmp_path / "all.mat", {"frames": stack})
    with pytest.raises(StoreError, match=r"its first axis counts the pictures, save .*permute"):
        guess_mapping(tmp_path, PROJECTOR)


def test_columns_may_run_down_the_picture(tmp_path: Path) -> None:
    pictures, white, black = frames([("columns", Stripes(bits=7))])
    named = {f"{i:02d}.png": p.T for i, p in enumerate([*pictures, white, black])}
    folder = write(tmp_path, named)
    mapping = guess_mapping(folder, (128, 40)).mapping
    assert mapping.parts[0] == StripePictures(bits=7)
    assert "turned by 90 degrees" in mapping.unsure[0]
    assert "turned by 90 degrees" in guess_mapping(folder).mapping.unsure[0]


def test_what_no_mapping_can_decode_is_refused(tmp_path: Path, gray: Pictures) -> None:
    folder = write(tmp_path / "gray", {f"{i:02d}.png": p for i, p in enumerate(gray)})
    with pytest.raises(StoreError, match=r"numbers \d+ to 12\d of columns, more than the 100 of"):
        guess_mapping(folder, (100, 96))
    one = frames([("columns", Phases(periods_px=(16,), steps=4))])[0]
    with pytest.raises(StoreError, match="sinusoids of one period, which the picture shows more than once"):
        guess_mapping(write(tmp_path / "one", {f"{i}.png": p for i, p in enumerate(one)}), PROJECTOR)
    same = frames([("columns", Phases(periods_px=(32, 8), steps=4))])[0]
    with pytest.raises(StoreError, match=r"4, 16 fringes .* look the same 4 times"):
        guess_mapping(write(tmp_path / "same", {f"{i}.png": p for i, p in enumerate(same)}), PROJECTOR)


def test_sinusoids_leave_their_way_open_and_wide_stripes_are_told(tmp_path: Path) -> None:
    waves = frames([("columns", Phases(periods_px=(128, 16), steps=4))])[0]
    told = guess_mapping(write(tmp_path / "w", {f"{i}.png": p for i, p in enumerate(waves)}), PROJECTOR)
    assert any("which way columns rise: to the right is assumed" in each for each in told.mapping.unsure)
    wide = frames([("columns", Stripes(bits=5, unit_px=4))])[0]
    told = guess_mapping(write(tmp_path / "s", {f"{i}.png": p for i, p in enumerate(wide)}), PROJECTOR)
    assert any("stripes are taken to be 4 px wide" in each for each in told.mapping.unsure)


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("scan.avi", "a video, which is not read. Save its frames as pictures"),
        ("scan.h5", "a file of HDF5, which is not read. Save its pictures"),
    ],
)
def test_what_is_not_read_is_named_with_what_to_do(tmp_path: Path, name: str, said: str) -> None:
    (tmp_path / name).write_bytes(b"1234")
    with pytest.raises(StoreError, match=f"{name} is {said}"):
        guess_mapping(tmp_path)


def test_a_lost_digit_is_refused_with_the_pictures_next_to_it(tmp_path: Path) -> None:
    pictures, white, black = frames([("columns", Stripes(bits=7, inverse=False))])
    del pictures[4]
    named = {f"{i:02d}.png": p for i, p in enumerate([white, black, *pictures])}
    with pytest.raises(
        StoreError, match=r"stripes of columns become four times finer from 05\.png to 06\.png"
    ):
        guess_mapping(write(tmp_path, named), PROJECTOR)


def test_a_pattern_in_the_place_of_an_inverse_is_named(tmp_path: Path, gray: Pictures) -> None:
    named = {f"{i:02d}.png": p for i, p in enumerate([*gray[:9], gray[2], *gray[10:]])}
    unsure = guess_mapping(write(tmp_path, named), PROJECTOR).mapping.unsure
    assert any("08.png and 09.png should be a pattern and its inverse" in each for each in unsure)


def test_the_same_picture_twice_is_named_where_nothing_makes_sense(tmp_path: Path) -> None:
    pictures = frames([("columns", Stripes(bits=7, inverse=False))])[0]
    again = frames([("columns", Stripes(bits=7, inverse=False))], seed=99)[0]
    both = [each for pair in zip(pictures, again, strict=True) for each in pair]
    with pytest.raises(StoreError, match=r"00\.png and 01\.png show the same\. Keep one picture of each"):
        guess_mapping(write(tmp_path, {f"{i:02d}.png": p for i, p in enumerate(both)}), PROJECTOR)


def test_scan_lines_among_the_pictures_are_asked_to_be_kept_elsewhere(
    tmp_path: Path, gray: Pictures, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("dsl_core.io.pictures.guess.MANY", len(gray))
    monkeypatch.setattr("dsl_core.io.pictures.guess.recognise", lambda *_: None)
    lines = [np.where(np.abs(np.arange(160) - 19 * k) < 2, gray[14], gray[15]) for k in range(8)]
    named = {f"{i:02d}.png": each for i, each in enumerate([*gray, *lines])}
    with pytest.raises(StoreError, match="Most codes have fewer than 24 pictures: keep those of other"):
        guess_mapping(write(tmp_path, named), PROJECTOR)


def test_inverses_may_be_told_by_the_ends_of_names(tmp_path: Path) -> None:
    named: dict[str, NDArray[np.uint16]] = {}
    for axis in ("columns", "rows"):
        pictures = frames([(axis, Stripes(bits=7))])[0]
        named |= {f"{axis}_{i // 2}{'-inv' if i % 2 else ''}.png": p for i, p in enumerate(pictures)}
    guess = guess_mapping(write(tmp_path, named), PROJECTOR)
    assert guess.mapping.parts == tuple(
        StripePictures.model_validate({"axis": axis, "bits": 7, "inverse_first": True})
        for axis in ("columns", "rows")
    )
    assert not guess.others


@pytest.mark.parametrize(
    ("as_they_are", "decoded", "taken"),
    [
        (AS_ENCODED - 0.01, 0.01, "as they are"),
        (AS_ENCODED, 0.01, "decoded"),
        (AS_ENCODED, 0.7, "as they are"),
        (None, 0.7, "decoded"),
        (0.7, None, "as they are"),
        (None, None, None),
    ],
)
def test_values_that_make_sense_as_they_are_are_not_taken_for_those_of_a_screen(
    monkeypatch: pytest.MonkeyPatch, as_they_are: float | None, decoded: float | None, taken: str | None
) -> None:
    misfits = {"as they are": as_they_are, "decoded": decoded}

    def recognise(probes: str, *_: object) -> object:
        misfit = misfits[probes]
        return None if misfit is None else SimpleNamespace(misfit=misfit, misfit_upright=misfit, of=probes)

    monkeypatch.setattr("dsl_core.io.pictures.guess.recognise", recognise)
    look: Any = SimpleNamespace(probes="as they are", decoded="decoded")
    found: Any = _recognised(look, (0, 1))
    assert (found and found.of) == taken


def test_looking_goes_on_for_absent_pictures_and_for_files_without_strays_alone() -> None:
    def candidate(files: str, left_out: int = 0) -> Candidate:
        return Candidate("a", (), (files,), left_out)

    every, without_strays, other = candidate("*"), candidate("a*", 2), candidate("b*", 2)
    absent = candidate("*")
    whole = [every, without_strays]
    assert _alike_next([every, absent], 0, whole)
    assert _alike_next([every, without_strays], 0, whole)
    assert not _alike_next([every, other], 0, whole)
    assert not _alike_next([without_strays, every], 0, whole)
    assert not _alike_next([every, without_strays], 1, whole)


@pytest.mark.parametrize("axes", [("columns",), ("columns", "rows")])
def test_black_and_a_closed_lens_are_no_digit(tmp_path: Path, axes: tuple[str, ...]) -> None:
    pictures, white, black = frames([(axis, Stripes(bits=7)) for axis in axes])
    dark = np.random.default_rng(3).normal(1, 0.6, white.shape).clip(0).round().astype(np.uint16)
    named = {f"pattern_{i:02d}.png": each for i, each in enumerate(pictures)}
    mapping = guess_mapping(
        write(tmp_path, {**named, "white.png": white, "black.png": black, "dark.png": dark}), PROJECTOR
    ).mapping
    stripes = [StripePictures.model_validate({"axis": axis, "bits": 7}) for axis in axes]
    assert mapping.parts == (BlackPicture(), *stripes, WhitePicture())
    assert mapping.files[0] == "black.png"
    assert mapping.unsure == ("1 picture does not belong to the code and is not used",)


def test_one_of_two_exposures_that_end_names_is_taken(tmp_path: Path, gray: Pictures) -> None:
    named = {f"{i}_{ms}ms.png": np.rint(p * (ms / 80)) for ms in (40, 80) for i, p in enumerate(gray)}
    guess = guess_mapping(write(tmp_path, named), PROJECTOR)
    assert guess.mapping.parts == (StripePictures(bits=7), WhitePicture(), BlackPicture())
    assert (guess.mapping.name, guess.others) == ("40ms", ("80ms",))


def test_pictures_of_8_and_of_16_bits_are_no_capture_together(tmp_path: Path, gray: Pictures) -> None:
    folder = write(tmp_path, {f"im{i + 1}.png": p for i, p in enumerate(gray)})
    cv2.imwrite(str(folder / "im3.png"), gray[2].astype(np.uint16) * 257)
    with pytest.raises(StoreError, match=r"im3\.png has values of 16 bits .*, the first picture of 8 "):
        guess_mapping(folder, PROJECTOR)
