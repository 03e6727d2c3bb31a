"""From pictures in any order of white, black, digits and steps: what each of them shows."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Literal

import numpy as np
import pytest
from numpy.typing import NDArray

from dsl_core.model.captured_code import Axis, CapturedCode, Phases, Stripes
from dsl_core.patterns.captured_code import captured_levels
from dsl_core.patterns.recognition.phase_sets import PhaseReading
from dsl_core.patterns.recognition.probes import ProbeTaker
from dsl_core.patterns.recognition.sequence import Recognised, Slots, is_same_light, recognise
from dsl_core.patterns.recognition.stripe_sets import StripeReading
from tests.cases.foreign_captures import PROJECTOR, frames, scene

Pictures = list[NDArray[np.uint16]]
Arrange = Callable[[Pictures, NDArray[np.uint16], NDArray[np.uint16]], Pictures]


def _recognised(
    pictures: Pictures, slots: Slots | None = None, most_bits: Mapping[Axis, int] | None = None
) -> Recognised | None:
    taker = ProbeTaker()
    for picture in pictures:
        taker.add(picture)
    return recognise(taker.finish(255.0), slots or tuple(range(len(pictures))), most_bits)


@pytest.mark.parametrize("rows", [1, 4])
def test_strips_of_a_few_rows_are_read_as_taller_pictures_are(rows: int) -> None:
    pictures, white, black = frames([("columns", Stripes(bits=7))])
    strip = [picture[:rows] for picture in (*pictures, white, black)]
    assert _stripes(_recognised(strip), "columns").bits == 7


def _stripes(found: Recognised | None, axis: str) -> StripeReading:
    assert found is not None
    reading = next(b.reading for b in found.blocks if b.axis == axis and b.kind == "stripes")
    assert isinstance(reading, StripeReading)
    return reading


@pytest.mark.parametrize(
    ("code", "arrange", "first", "inverse", "inverse_first"),
    [
        (Stripes(bits=7), lambda f, w, b: [*f, w, b], "most", "interleaved", False),
        (Stripes(bits=7), lambda f, w, b: [b, w, *f[1::2], *f[0::2]], "most", "after", True),
        (Stripes(bits=7, inverse=False), lambda f, w, b: [w, *f[::-1]], "least", "none", False),
        (Stripes(bits=7, inverse=False, code="binary"), lambda f, w, b: [b, *f, w], "most", "none", False),
        (Stripes(bits=7, code="xor", base_bit=1), lambda f, w, b: [*f, b], "most", "interleaved", False),
    ],
)
def test_digits_are_told_by_how_steadily_their_numbers_run(
    code: Stripes, arrange: Arrange, first: str, inverse: str, inverse_first: bool
) -> None:
    found = _recognised(arrange(*frames([("columns", code)])))
    reading = _stripes(found, "columns")
    assert (reading.code, reading.bits, reading.base_bit) == (code.code, 7, code.base_bit)
    assert (reading.first, reading.inverse, reading.inverse_first) == (first, inverse, inverse_first)
    assert reading.is_sure
    assert reading.rises


@pytest.mark.parametrize(
    "code", [Stripes(bits=7, code="binary"), Stripes(bits=7), Stripes(bits=7, code="xor")]
)
@pytest.mark.parametrize("inverse", [True, False])
@pytest.mark.parametrize("first", ["most", "least"])
def test_digits_of_a_mirrored_picture_fall_and_are_not_taken_for_inverses(
    code: Stripes, inverse: bool, first: str
) -> None:
    pictures, white, black = frames([("columns", code.model_copy(update={"inverse": inverse}))])
    step = 2 if inverse else 1
    digits = [pictures[k : k + step] for k in range(0, len(pictures), step)]
    ordered = digits if first == "most" else digits[::-1]
    run = [picture for digit in ordered for picture in digit]
    found = _recognised([each[:, ::-1] for each in [*run, white, black]])
    reading = _stripes(found, "columns")
    assert (reading.code, reading.first, reading.inverse_first) == (code.code, first, False)
    assert not reading.rises
    assert reading.is_sure


@pytest.mark.slow
def test_rows_and_columns_are_told_apart_in_either_order_and_with_a_picture_absent() -> None:
    pictures, white, black = frames([("rows", Stripes(bits=7)), ("columns", Stripes(bits=7))])
    whole = [white, black, *pictures]
    found = _recognised(whole)
    assert found is not None
    assert [(b.kind, b.axis, len(b.slots)) for b in found.blocks] == [
        ("white", "columns", 1),
        ("black", "columns", 1),
        ("stripes", "rows", 14),
        ("stripes", "columns", 14),
    ]
    slots = tuple(i if i < 7 else None if i == 7 else i - 1 for i in range(30))
    lacking = _recognised(whole[:7] + whole[8:], slots)
    assert _stripes(lacking, "rows").bits == _stripes(lacking, "columns").bits == 7


@pytest.mark.slow
def test_sinusoids_are_told_by_their_steps_and_their_fringes() -> None:
    sets = [("columns", Phases(periods_px=tuple(128 / n for n in (12, 11, 10)), steps=3, start_deg=-90))]
    found = _recognised(frames(sets)[0])
    assert found is not None
    (block,) = found.blocks
    assert isinstance(block.reading, PhaseReading)
    assert (block.reading.steps, block.reading.fringes, block.reading.order) == (3, (12.0, 11.0, 10.0), "set")
    assert (block.reading.start_deg, block.reading.direction) == (-90.0, 1)
    assert block.reading.off_rad < 0.3 * block.reading.chance_rad
    pictures = frames([("columns", Phases(periods_px=(128, 32, 8), steps=4, direction=-1))])[0]
    strided = _recognised([pictures[s * 4 + k] for k in range(4) for s in range(3)])
    assert strided is not None
    reading = strided.blocks[0].reading
    assert isinstance(reading, PhaseReading)
    assert (reading.order, reading.fringes, reading.direction) == ("step", (1.0, 4.0, 16.0), -1)


def test_pictures_of_no_code_make_no_sense() -> None:
    rng = np.random.default_rng(3)
    noise: Sequence[NDArray[np.uint16]] = [rng.integers(0, 255, (48, 64), np.uint16) for _ in range(10)]
    assert _recognised(list(noise)) is None


@pytest.mark.slow
@pytest.mark.parametrize(
    ("fringes", "steps", "start", "direction"),
    [((1, 4, 16), 3, -120.0, 1), ((1, 9), 3, 120.0, -1), ((8, 1), 5, 36.0, 1)],
)
def test_sinusoids_may_start_anywhere_and_end_with_the_projector(
    fringes: tuple[int, ...], steps: int, start: float, direction: Literal[1, -1]
) -> None:
    periods = tuple(128 / n for n in fringes)
    code = Phases(periods_px=periods, steps=steps, start_deg=start, direction=direction)
    found = _recognised(frames([("columns", code)])[0])
    assert found is not None
    (block,) = found.blocks
    assert isinstance(block.reading, PhaseReading)
    assert (block.axis, block.reading.steps, block.reading.fringes) == ("columns", steps, fringes)
    assert (block.reading.start_deg, block.reading.direction) == (start, direction)


@pytest.mark.slow
def test_one_fringe_is_not_taken_for_another_axis() -> None:
    dark = [
        np.asarray(np.rint(255 * (p / 255) ** (1 / 2.2)), np.uint16)
        for p in frames([("columns", Phases(periods_px=(128, 16, 8), steps=4))])[0]
    ]
    found = _recognised(dark)
    assert found is not None
    assert found.digits == {("columns", 3)}


def test_lights_beside_stripes_are_no_steps_of_a_sinusoid() -> None:
    pictures, white, black = frames([("columns", Stripes(bits=7))])
    dim = np.asarray(0.95 * white, np.uint16)
    found = _recognised([*pictures, white, black, dim])
    assert found is not None
    assert [(kind, count) for kind, _, count in found.content] == [("stripes", 14), ("skip", 3)]
    assert _stripes(found, "columns").bits == 7


#: Where white (W) and black (B) were taken besides the pictures of columns and rows.
@pytest.mark.parametrize("order", ["WBcWB", "BWcBW", "WBcWBr", "cWBrWB", "WWBBc", "cWBW"])
@pytest.mark.parametrize(("code", "inverse"), [("gray", True), ("binary", False)])
def test_white_and_black_taken_twice_are_no_coarsest_digit(
    order: str, code: Literal["gray", "binary"], inverse: bool
) -> None:
    digits = Stripes(code=code, bits=7, inverse=inverse)
    sets = {letter: frames([(axis, digits)])[0] for letter, axis in (("c", "columns"), ("r", "rows"))}
    seen, pictures = scene(), []
    for number, letter in enumerate(order):
        level = np.full((96, 128), float(letter == "W"))
        pictures += sets.get(letter) or [seen.picture(level, 700 + number)]
    found = _recognised(pictures, most_bits={"columns": 7, "rows": 7})
    assert found is not None
    for axis in ("columns", "rows")[: 1 + ("r" in order)]:
        reading = _stripes(found, axis)
        assert (reading.bits, reading.rises) == (7, True)
    kinds = [block.kind for block in found.blocks]
    assert kinds.count("white") == kinds.count("black") == 1
    spare = sum(len(block.slots) for block in found.blocks if block.kind == "skip")
    assert spare == sum(map(order.count, "WB")) - 2


def test_the_very_same_pictures_once_more_are_no_sinusoid(recwarn: pytest.WarningsRecorder) -> None:
    pictures, white, black = frames([("columns", Stripes(bits=7))])
    found = _recognised([white, white, black, black, *pictures])
    assert _stripes(found, "columns").bits == 7
    assert not list(recwarn)


def test_white_before_a_gray_code_turns_no_numbers_round_where_no_projector_is_known() -> None:
    pictures, white, black = frames([("columns", Stripes(bits=7))])
    found = _recognised([white, black, *pictures, white, black])
    reading = _stripes(found, "columns")
    assert (reading.bits, reading.rises) == (7, True)


def test_the_coarsest_digit_of_half_a_projector_is_no_white_taken_twice() -> None:
    whole = scene()
    half = replace(whole, columns=64 + 0.45 * whole.columns)
    code = CapturedCode(column_sets=(Stripes(bits=7),))
    levels = [captured_levels(code, PROJECTOR, index) for index in range(14)]
    levels += [np.ones((96, 128)), np.zeros((96, 128))]
    pictures = [half.picture(each, k, 8) for k, each in enumerate(levels)]
    limits: tuple[Mapping[Axis, int] | None, ...] = (None, {"columns": 7, "rows": 7})
    for most_bits in limits:
        reading = _stripes(_recognised(pictures, most_bits=most_bits), "columns")
        assert (reading.bits, reading.rises) == (7, True)
        assert reading.numbers[0] >= 64


@pytest.mark.parametrize(
    ("one", "other", "same"),
    [
        (0.99, 0.975, True), (0.99, 0.965, False), (0.03, 0.015, True), (0.03, 0.005, False),
        (0.5, 0.5, False), (0.9, 0.91, False), (0.1, 0.09, False),
    ],
)  # fmt: skip
def test_lights_are_the_same_where_a_lamp_may_have_drifted(one: float, other: float, same: bool) -> None:
    assert is_same_light(one, other) is same
    assert is_same_light(other, one) is same


def test_a_digit_that_is_blurred_to_grey_is_no_light_that_is_left_out() -> None:
    pictures, white, black = frames([("columns", Stripes(bits=7))])
    grey = np.asarray((white + black) // 2, np.uint16)
    found = _recognised([*pictures, grey, grey, white, black])
    assert found is None or all(block.kind != "skip" for block in found.blocks)


@pytest.mark.parametrize(("share", "noise"), [(0.45, 0.004), (1.0, 0.1)])
def test_white_and_black_are_no_coarse_digit_of_a_part_or_among_noise(share: float, noise: float) -> None:
    whole = scene()
    seen = replace(whole, columns=share * whole.columns)
    code = CapturedCode(column_sets=(Stripes(bits=7),))
    levels = [np.ones((96, 128)), np.zeros((96, 128))]
    levels += [captured_levels(code, PROJECTOR, index) for index in range(14)]
    found = _recognised([seen.picture(each, k, 8, noise) for k, each in enumerate(levels)])
    reading = _stripes(found, "columns")
    assert (reading.bits, reading.inverse, reading.rises) == (7, "interleaved", True)
    assert found is not None
    assert [block.kind for block in found.blocks] == ["white", "black", "stripes"]


@pytest.mark.slow
def test_noisy_sinusoids_are_not_taken_for_finer_ones_that_fit_anything() -> None:
    seen, code = scene(), Phases(periods_px=(128, 8), steps=8)
    levels = [captured_levels(CapturedCode(column_sets=(code,)), PROJECTOR, k) for k in range(16)]
    found = _recognised([seen.picture(each, k, 8, 0.03) for k, each in enumerate(levels)])
    assert found is not None
    (reading,) = [block.reading for block in found.blocks]
    assert isinstance(reading, PhaseReading)
    assert (reading.fringes, reading.start_deg) == ((1.0, 16.0), 0.0)
    assert reading.rival_rad > 1.1 * reading.off_rad


def test_steps_after_stripes_with_inverses_are_no_finer_digits() -> None:
    code = Stripes(bits=4, unit_px=8)
    sets: list[tuple[str, Stripes | Phases]] = [("columns", code)]
    sets += [("columns", Phases(periods_px=(8.0,), steps=4))]
    pictures, white, black = frames(sets, camera=(120, 90))
    found = _recognised([white, black, *pictures])
    assert found is not None
    assert [(kind, count) for kind, _, count in found.content] == [
        ("white", 1), ("black", 1), ("stripes", 8), ("phases", 4)
    ]  # fmt: skip
