"""Pairs of a code whose pattern and inverse changed places stand out by the columns they give."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.capture.proof.code_pairs import Pair
from dsl_core.capture.proof.columns import decode, exchanged_pairs
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


@pytest.mark.parametrize("number", [6, 7])
def test_a_fine_pair_is_named_alone(number: int) -> None:
    assert _suspects(number) == (number,)


def test_a_picture_turned_around_says_nothing_where_nobody_knows_which_way_columns_rise() -> None:
    assert _suspects(0, None) == ()
