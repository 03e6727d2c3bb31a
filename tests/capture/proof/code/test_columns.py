"""Pairs of a code whose pattern and inverse changed places stand out by the columns they give."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from dsl_core.capture.proof.code import columns
from dsl_core.capture.proof.code.code_pairs import Pair
from dsl_core.capture.proof.code.columns import (
    _Neighbours,
    _of_columns,
    decode,
    exchanged_pairs,
    run_backwards,
)
from dsl_core.model.plan import GrayCode
from dsl_core.patterns.gray_code import code_image

CODE, SIZE = GrayCode(rows=False), (256, 4)
SHAPE = (20, 180)
#: Two surfaces, one before the other.
COLUMN = (np.arange(180) * 1.2 + np.where(np.arange(180) > 70, 12, 0)).astype(int)


def _pairs(exchanged: int | None = None) -> dict[int, Pair]:
    found = {}
    for number in range(8):
        one, other = (
            np.tile(code_image(CODE, SIZE, 2 * number + inverse)[0, COLUMN].astype(np.uint16) * 4 + 100, 20)
            for inverse in (0, 1)
        )
        found[number] = (other, one) if number == exchanged else (one, other)
    return found


def _suspects(exchanged: int | None, rises: bool | None = True) -> tuple[int, ...]:
    trusted = np.ones(SHAPE[0] * SHAPE[1], bool)
    return exchanged_pairs(CODE, SIZE, _pairs(exchanged), trusted, SHAPE, rises)


def test_columns_are_decoded_on_the_raster() -> None:
    column, margin = decode(CODE, SIZE, _pairs())
    np.testing.assert_array_equal(column.reshape(SHAPE)[3], COLUMN)
    assert margin.min() == 1020


def test_sound_pairs_are_not_suspected() -> None:
    assert _suspects(None) == ()
    assert _suspects(None, None) == ()


@pytest.mark.parametrize("number", range(8))
def test_an_exchanged_pair_is_among_the_suspects(number: int) -> None:
    assert number in _suspects(number)


def _seen(code_at: NDArray[np.int64], exchanged: int | None) -> tuple[int, ...]:
    """Suspects of an uncalibrated camera whose pixels see code blurred over three columns."""
    found = {}
    for number in range(8):
        one, other = (
            sum(
                code_image(CODE, SIZE, 2 * number + inverse)[0, np.clip(code_at + by, 0, 255)].astype(float)
                for by in (-1, 0, 1)
            ).astype(np.uint16).ravel()
            for inverse in (0, 1)
        )  # fmt: skip
        found[number] = (other, one) if number == exchanged else (one, other)
    return exchanged_pairs(CODE, SIZE, found, np.ones(code_at.size, bool), code_at.shape, None)


@pytest.mark.parametrize("exchanged", [None, 3, 4, 5, 6])
@pytest.mark.parametrize("turn", ["as it is", "upside down", "upright", "upright, the other way"])
def test_a_pair_is_named_however_an_uncalibrated_camera_is_turned(turn: str, exchanged: int | None) -> None:
    across = np.tile(COLUMN, (20, 1))
    turned = {
        "as it is": across,
        "upside down": across[:, ::-1],
        "upright": across.T,
        "upright, the other way": across.T[::-1],
    }[turn]
    assert _seen(turned, exchanged) == (() if exchanged is None else (exchanged,))


def test_an_upright_camera_is_not_mirrored_where_surfaces_are_tilted() -> None:
    """Columns fall along its rows by a tilt, and change three times as much down its picture."""
    down, across = np.mgrid[:100, :30]
    column = (2.1 * down + 25 - 0.7 * across).astype(int)
    pairs = {}
    for number in range(8):
        one, other = (code_image(CODE, SIZE, 2 * number + inverse)[0, column].ravel() for inverse in (0, 1))
        pairs[number] = one.astype(np.uint16), other.astype(np.uint16)
    trusted = np.ones(column.size, bool)
    assert not run_backwards(CODE, SIZE, pairs, trusted, column.shape, True)
    assert run_backwards(CODE, SIZE, pairs, trusted, column.shape, True, rows_px=40.0), "rows are far apart"


@pytest.mark.parametrize("number", [6, 7])
def test_a_fine_pair_is_named_alone(number: int) -> None:
    assert _suspects(number) == (number,)


def test_a_picture_turned_around_says_nothing_where_nobody_knows_which_way_columns_rise() -> None:
    assert _suspects(0, None) == ()


def judged(row: list[int]) -> tuple[float, float] | None:
    return _Neighbours((1, len(row)), np.ones(len(row), bool), np.array(row, np.int32)).as_taken


@pytest.mark.parametrize("rises", [True, False])
def test_columns_that_fall_where_they_should_rise_are_those_of_a_mirrored_picture(rises: bool) -> None:
    pairs, trusted = _pairs(), np.ones(SHAPE[0] * SHAPE[1], bool)
    mirrored = {
        number: tuple(np.ascontiguousarray(one.reshape(SHAPE)[:, ::-1]).ravel() for one in pair)
        for number, pair in pairs.items()
    }
    assert run_backwards(CODE, SIZE, pairs, trusted, SHAPE, rises) == (not rises)
    assert run_backwards(CODE, SIZE, mirrored, trusted, SHAPE, rises) == rises  # type: ignore[arg-type]
    assert not run_backwards(CODE, SIZE, mirrored, ~trusted, SHAPE, rises)  # type: ignore[arg-type]


def test_neighbours_are_judged_from_sixty_triples_on() -> None:
    assert judged(list(range(61))) is None
    # Column 0 is as good as any.
    assert judged(list(range(62))) == (0.0, 1.0)
    assert judged([-1, *range(1, 62)]) is None
    assert _Neighbours((1, 62), np.arange(62) > 0, np.arange(62, dtype=np.int32)).as_taken is None


def test_columns_rise_by_steps_of_up_to_twenty() -> None:
    stairs = [20 * i for i in range(70)]
    assert judged(stairs) == (0.0, 1.0)
    assert judged(stairs[::-1]) == (0.0, -1.0)
    assert judged([21 * i for i in range(70)]) == (0.0, 0.0), "no neighbours on one surface"
    rises = judged([5 * (i % 2) for i in range(71)])
    assert rises is not None
    assert rises[1] == 0.0


def test_roughness_is_the_mean_second_difference_clipped_at_six_times_the_first_median() -> None:
    step = np.r_[np.zeros(35), np.full(35, 30)].astype(np.int32) + np.arange(70, dtype=np.int32)
    asked = _Neighbours((1, 70), np.ones(70, bool), step)
    # Two second differences of thirty, at a median below one: six of each count.
    assert asked.as_taken == pytest.approx((12 / 68, 1.0))
    saw = (9 * (np.arange(70) % 2)).astype(np.int32)
    found = asked.judge(saw)
    assert found is not None
    assert found[0] == 6.0, "the first picture's clip stays"
    own = _Neighbours((1, 70), np.ones(70, bool), saw).as_taken
    assert own is not None
    assert own[0] == 18.0


def test_pairs_of_rows_are_left_alone() -> None:
    pairs = dict.fromkeys(range(20), (np.zeros(1, np.uint16), np.zeros(1, np.uint16)))
    # Eight bits of columns, two of rows, and the same of a second setting.
    assert _of_columns(GrayCode(rows=True), pairs, SIZE) == [*range(8), *range(10, 18)]
    assert _of_columns(GrayCode(rows=False), pairs, SIZE) == list(range(20))


def suspects_of(
    monkeypatch: pytest.MonkeyPatch,
    table: dict[int | None, tuple[float, float] | None],
    rises: bool | None = True,
) -> tuple[int, ...]:
    """The suspects where pairs exchanged (None: as taken) leave columns so rough, so far rising."""

    class Known:
        is_upright, as_taken = False, table[None]

        def __init__(self, *_: object) -> None: ...

        def judge(self, number: int | None) -> tuple[float, float] | None:
            return table[number]

    monkeypatch.setattr(columns, "_Neighbours", Known)
    monkeypatch.setattr(columns, "decode", lambda code, size, pairs, number=None: (number, None))
    pair = (np.zeros(1, np.uint16), np.zeros(1, np.uint16))
    pairs = {number: pair for number in table if number is not None}
    return exchanged_pairs(CODE, SIZE, pairs, np.ones(1, bool), (1, 1), rises)


def test_undoing_a_pair_has_to_make_columns_a_quarter_smoother(monkeypatch: pytest.MonkeyPatch) -> None:
    assert suspects_of(monkeypatch, {None: (1.3, 0.9), 0: (2.0, 0.9), 1: (1.0, 0.9)}) == (1,)
    assert suspects_of(monkeypatch, {None: (1.2, 0.9), 0: (2.0, 0.9), 1: (1.0, 0.9)}) == ()
    assert suspects_of(monkeypatch, {None: None, 0: (1.0, 0.9)}) == ()
    assert suspects_of(monkeypatch, {None: (9.0, 0.9), 0: None}) == ()


def test_undone_columns_have_to_rise(monkeypatch: pytest.MonkeyPatch) -> None:
    assert suspects_of(monkeypatch, {None: (9.0, 0.9), 0: (1.0, 0.59)}) == ()
    assert suspects_of(monkeypatch, {None: (9.0, 0.9), 0: (1.0, 0.6)}) == (0,)
    assert suspects_of(monkeypatch, {None: (9.0, -0.9), 0: (1.0, -0.6)}, rises=False) == (0,)
    assert suspects_of(monkeypatch, {None: (9.0, 0.9), 0: (1.0, 0.6)}, rises=False) == ()


def test_of_columns_turned_around_all_pairs_that_leave_them_nearly_as_smooth_are_suspects(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    table: dict[int | None, tuple[float, float] | None] = {0: (2.9, 0.9), 1: (1.0, 0.9), 2: (3.1, 0.9)}
    assert suspects_of(monkeypatch, {None: (1.0, 0.19), **table}) == (0, 1)
    assert suspects_of(monkeypatch, {None: (1.0, 0.19), **table}, rises=None) == ()
    assert suspects_of(monkeypatch, {None: (2.9, 0.19), **table}, rises=None) == (1,)
    turned = {**table, 1: (1.0, -0.9)}
    assert suspects_of(monkeypatch, {None: (2.9, 0.19), **turned}, rises=None) == (1,), "whichever way"
    assert suspects_of(monkeypatch, {None: (2.9, 0.19), **turned, 2: (1.3, 0.9)}, rises=None) == ()
    assert suspects_of(monkeypatch, {None: (2.9, 0.19), **turned, 1: (1.0, 0.5)}, rises=None) == ()
    rough: dict[int | None, tuple[float, float] | None] = {0: (29.0, 0.9), 1: (2.1, 0.9), 2: (31.0, 0.9)}
    assert suspects_of(monkeypatch, {None: (29.0, 0.9), **rough}, rises=None) == (), "columns at random"
    assert suspects_of(monkeypatch, {None: (1.0, 0.2), **table}) == ()


def test_rows_take_as_many_bits_as_their_number_needs() -> None:
    pairs = dict.fromkeys(range(22), (np.zeros(1, np.uint16), np.zeros(1, np.uint16)))
    assert _of_columns(GrayCode(rows=True), pairs, (256, 5)) == [*range(8), *range(11, 19)]
    assert _of_columns(GrayCode(rows=True), pairs, (257, 4)) == [*range(9), *range(11, 20)]
    assert _of_columns(GrayCode(rows=False), pairs, (256, 5)) == list(range(22))


def test_only_neighbours_that_are_both_trusted_say_whether_columns_rise() -> None:
    row, trusted = np.arange(90, dtype=np.int32), np.ones(90, bool)
    # From the seventieth on every second one is not trusted, and far below its neighbours.
    row[71::2] -= 15
    trusted[71::2] = False
    assert _Neighbours((1, 90), trusted, row).as_taken == (0.0, 1.0)


@pytest.mark.parametrize("rises", [True, False])
def test_columns_of_which_a_quarter_is_right_are_not_surely_mirrored(rises: bool) -> None:
    pairs, trusted = _pairs(), np.ones(SHAPE[0] * SHAPE[1], bool)
    for wrong, is_mirrored in ((0.75, False), (0.9, True)):
        turned = {
            number: tuple(_turned(one.reshape(SHAPE), wrong if rises else 1 - wrong).ravel() for one in pair)
            for number, pair in pairs.items()
        }
        assert run_backwards(CODE, SIZE, turned, trusted, SHAPE, rises) == is_mirrored  # type: ignore[arg-type]


def _turned(picture: NDArray[np.uint16], share: float) -> NDArray[np.uint16]:
    """A picture whose upper rows, a share of all, run backwards."""
    found = picture.copy()
    rows = round(share * len(picture))
    found[:rows] = picture[:rows, ::-1]
    return found
