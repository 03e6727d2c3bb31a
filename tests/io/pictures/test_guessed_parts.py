"""Sizes of projectors from digits, and parts of a mapping from what was recognised."""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import replace

import numpy as np
import pytest

from dsl_core.errors import StoreError
from dsl_core.io.pictures.guessed_parts import _stripes, _unit, guessed_size, part_of, untold_width
from dsl_core.io.pictures.mapping import PhasePictures, Skipped, StripePictures, WhitePicture
from dsl_core.model.captured_code import Axis
from dsl_core.patterns.recognition.phase_sets import PhaseReading
from dsl_core.patterns.recognition.probes import Lines, Probes
from dsl_core.patterns.recognition.sequence import Block
from dsl_core.patterns.recognition.stripe_sets import StripeReading

READING = StripeReading(
    code="gray", base_bit=0, bits=10, first="most", inverse="interleaved", inverse_first=False,
    roughness=0.0, rival=1.0, numbers=(3, 1000), rises=True,
)  # fmt: skip
SINUSOID = PhaseReading(4, "set", (1.0,), 0.0, 1, 0.01, 1.0)


def stripes(axis: Axis, bits: int, most: int, **other: object) -> Block:
    return Block("stripes", (), axis, replace(READING, bits=bits, numbers=(0, most), **other))  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "size",
    [
        (1024, 768), (1280, 800), (1920, 1080), (854, 480), (912, 1140), (1140, 912), (1920, 1200),
        (2560, 1600), (3840, 2160),
    ],
)  # fmt: skip
def test_a_common_projector_is_known_by_its_last_column_and_row(size: tuple[int, int]) -> None:
    width, height = size
    blocks = [
        stripes("columns", (width - 1).bit_length(), width - 1),
        stripes("rows", (height - 1).bit_length(), height - 1),
    ]
    found, said = guessed_size(blocks)
    assert found == size
    assert f"{(width - 1).bit_length()} bits of columns up to {width - 1} and" in said


@pytest.mark.parametrize(
    ("most", "size"),
    [
        (1023, (1024, 768)),
        (799, (1024, 768)),
        (1024, (1280, 800)),
        (1280, (1920, 1080)),
        (1920, (2048, 1536)),
    ],
)
def test_the_commonest_projector_that_has_the_columns_is_taken(most: int, size: tuple[int, int]) -> None:
    assert guessed_size([stripes("columns", most.bit_length(), most)])[0] == size


@pytest.mark.parametrize(
    ("rows", "size"), [(479, (854, 480)), (359, (854, 480)), (767, (1024, 768)), (1050, (1920, 1080))]
)
def test_rows_alone_find_a_projector_too(rows: int, size: tuple[int, int]) -> None:
    assert guessed_size([stripes("rows", rows.bit_length(), rows)])[0] == size


def test_a_projector_of_no_common_size_has_as_many_pixels_as_numbers() -> None:
    assert guessed_size([stripes("columns", 7, 100)])[0] == (128, 96)
    assert guessed_size([stripes("rows", 7, 100)])[0] == (170, 128)
    assert guessed_size([stripes("columns", 7, 100), stripes("rows", 6, 50)])[0] == (128, 64)


def test_sinusoids_say_no_size() -> None:
    phases = Block("phases", (0, 1, 2, 3), "columns", SINUSOID)
    size, said = guessed_size([phases, stripes("columns", 5, 20)])
    assert size == (1024, 768)
    assert "phases do not say the size" in said


@pytest.mark.parametrize(
    ("length", "bits", "numbers", "unit"),
    [
        (1024, 10, (3, 1000), 1),
        (1025, 10, (3, 1000), 2),
        (1280, 9, (3, 318), 4),  # the finest two of 11 digits are left out
        (1080, 9, (3, 268), 4),
        (640, 8, (50, 100), 4),
        (1280, 9, (100, 410), 4),  # centred on the projector
        (1280, 9, (3, 420), 3),  # more numbers than stripes of 4 px have
        (1280, 7, (3, 126), 10),
        (600, 10, (3, 500), 1),
    ],
)
def test_stripes_are_as_wide_as_if_the_finest_digits_were_left_out(
    length: int, bits: int, numbers: tuple[int, int], unit: int
) -> None:
    assert _unit(replace(READING, bits=bits, numbers=numbers), length) == unit


def test_that_stripes_may_be_of_another_width_is_said() -> None:
    part, (doubt,) = part_of(stripes("columns", 9, 310), [], (1280, 800), None)  # type: ignore[arg-type]
    assert isinstance(part, StripePictures)
    assert part.unit_px == 4
    assert "taken to be 4 px wide, not 3 px, which just covers them" in doubt
    assert "not 3" not in part_of(stripes("rows", 9, 190), [], (1280, 1024), None)[1][0]  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("most", "size", "turned", "asks"),
    [
        (38, (1280, 800), False, "stripes of 20 px just cover 1280 px, those of 32 px do as well"),
        (38, (800, 1280), True, "stripes of 20 px just cover 1280 px"),
        (60, (1280, 800), False, ""),
        (38, (1024, 768), False, ""),
    ],
)
def test_a_period_that_stripes_do_not_tell_is_asked_for(
    most: int, size: tuple[int, int], turned: bool, asks: str
) -> None:
    blocks = [stripes("columns", 6, most), Block("phases", (0, 1, 2, 3), "columns", SINUSOID)]
    said = untold_width(blocks, size, turned)
    assert asks in said
    assert bool(asks) == bool(said)
    assert untold_width(blocks[:1], size, turned) == ""


@pytest.mark.parametrize(
    ("axis", "most", "offset"),
    [("columns", 800, 112), ("columns", 799, 0), ("rows", 600, 212), ("rows", 599, 0)],
)
def test_numbers_beyond_the_projector_are_centred_on_it(axis: Axis, most: int, offset: int) -> None:
    block = stripes(axis, 10, most)
    assert isinstance(block.reading, StripeReading)
    part, doubts = _stripes(axis, block.reading, (800, 600))
    assert isinstance(part, StripePictures)
    assert (part.offset, part.unit_px, part.bits, part.axis) == (offset, 1, 10, axis)
    assert bool(doubts) == bool(offset)


def test_what_is_unsure_of_stripes_is_said() -> None:
    unsure = stripes("columns", 10, 500, roughness=0.5, rival=0.5)
    falling = stripes("columns", 10, 500, rises=False)
    for block, said in ((unsure, "another code or order of digits"), (falling, "fall along the picture")):
        (doubt,) = part_of(block, [block], (1024, 768), None)[1]  # type: ignore[arg-type]
        assert said in doubt
    assert part_of(Block("white", (0,)), [], (4, 3), None) == (WhitePicture(), [])  # type: ignore[arg-type]


@pytest.mark.parametrize(("inverse_first", "other"), [(False, "true"), (True, "false")])
def test_binary_digits_may_be_those_of_a_mirrored_picture_which_is_said(
    inverse_first: bool, other: str
) -> None:
    block = stripes("columns", 10, 500, code="binary", inverse_first=inverse_first)
    (doubt,) = part_of(block, [block], (1024, 768), None)[1]  # type: ignore[arg-type]
    assert "the picture is mirrored" in doubt
    assert doubt.endswith(f"set inverse_first of the mapping to {other}")


@pytest.mark.parametrize(
    ("low", "rows", "offset", "said"),
    [
        (5, (250, 700), 0, ""),  # numbers that a centred count does not have
        (150, (250, 700), 112, "centred, as those of the other axis"),
        (150, (5, 300), 0, "counted from 0"),
        (150, (250, 500), 0, "counted from 0"),
    ],
)
def test_numbers_of_a_part_may_be_centred_as_those_of_the_other_axis(
    low: int, rows: tuple[int, int], offset: int, said: str
) -> None:
    across = Block("stripes", (), "columns", replace(READING, numbers=(low, 700)))
    down = Block("stripes", (), "rows", replace(READING, numbers=rows))
    part, doubts = part_of(across, [across, down], (800, 600), None)  # type: ignore[arg-type]
    assert isinstance(part, StripePictures)
    assert part.offset == offset
    assert [said in doubt for doubt in doubts] == [True] * bool(said)


@pytest.mark.parametrize(
    ("fringes", "off_rad", "ends"),
    [
        ((1.0, 6.0, 36.0), 0.02, "well"),
        ((1.0, 6.0, 36.0), 0.11, "doubtful"),
        ((2.0, 11.0, 65.0), 0.11, "refused"),
        ((1.0, 6.0, 36.0), 0.14, "refused"),
    ],
)
def test_sinusoids_that_agree_no_better_than_by_chance_are_refused(
    fringes: tuple[float, ...], off_rad: float, ends: str
) -> None:
    lines = Lines(np.zeros((9, 2, 4), np.float32), np.ones((2, 4), np.bool_))
    block = Block(
        "phases", tuple(range(9)), "columns", PhaseReading(3, "set", fringes, 0.0, 1, off_rad, 0.3, 0.16)
    )
    with (
        pytest.raises(StoreError, match=r", the best, they are off by 0\.1\d rad, and 0\.16 would be chance")
        if ends == "refused"
        else nullcontext()
    ):
        part, doubts = part_of(block, [block], (512, 384), Probes(lines, lines, 1.0))
        assert part.kind == "phases"
        assert any("hardly agree" in doubt for doubt in doubts) == (ends == "doubtful")


def test_stripes_say_the_period_of_sinusoids_beside_them(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("dsl_core.io.pictures.guessed_parts.numbers_of", lambda *known: None)
    monkeypatch.setattr("dsl_core.io.pictures.guessed_parts.turns_per_number", lambda *known: (0.25, 90.0))
    lines = Lines(np.zeros((9, 2, 4), np.float32), np.ones((2, 4), np.bool_))
    phases = Block(
        "phases", tuple(range(9)), "columns", PhaseReading(3, "set", (8.0, 4.0, 1.0), 0.0, 1, 0.02, 0.3, 0.16)
    )
    part, _ = part_of(phases, [phases, stripes("columns", 9, 511)], (512, 384), Probes(lines, lines, 1.0))
    assert isinstance(part, PhasePictures)
    assert (part.fringes, part.start_deg) == ((128.0, 64.0, 16.0), 90.0)


def test_pictures_that_are_no_part_of_the_code_are_left_out_and_counted() -> None:
    part, (doubt,) = part_of(Block("skip", (4, 5, 6)), [], (4, 3), None)  # type: ignore[arg-type]
    assert part == Skipped(count=3)
    assert doubt == "3 pictures next to the stripes show no pattern and are not used"
