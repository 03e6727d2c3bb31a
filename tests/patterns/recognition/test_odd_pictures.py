"""A lost digit, a pair that is none and a picture that comes twice are found among the others."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from dsl_core.model.captured_code import Stripes
from dsl_core.patterns.recognition.odd_pictures import lost_after, odd_pairs, same_in_a_row
from dsl_core.patterns.recognition.probes import Lines, ProbeTaker
from dsl_core.patterns.recognition.stripe_sets import StripeReading, read_set
from tests.cases.foreign_captures import blurred, frames

Pictures = list[NDArray[np.uint16]]


def _lines(pictures: Pictures) -> Lines:
    taker = ProbeTaker()
    for picture in pictures:
        taker.add(picture)
    return taker.finish(255.0).across


def _read(lines: Lines) -> StripeReading:
    found = read_set(lines, range(len(lines.values)))
    assert found is not None
    return found


def _digits(code: str, inverse: bool) -> Pictures:
    return frames([("columns", Stripes.model_validate({"code": code, "bits": 7, "inverse": inverse}))])[0]


@pytest.mark.parametrize("code", ["gray", "binary"])
@pytest.mark.parametrize("inverse", [False, True])
def test_a_digit_that_was_lost_leaves_a_step_of_four(code: str, inverse: bool) -> None:
    pictures, each = _digits(code, inverse), 2 if inverse else 1
    whole = _lines(pictures)
    assert lost_after(whole, range(len(pictures)), _read(whole)) is None
    lacking = _lines(pictures[: 4 * each] + pictures[5 * each :])
    places = range(len(lacking.values))
    assert lost_after(lacking, places, _read(lacking)) == (3 * each, 4 * each)
    assert lost_after(lacking, places[::-1], _read(_lines_back(lacking))) == (
        3 * each + each - 1,
        4 * each + each - 1,
    )


def _lines_back(lines: Lines) -> Lines:
    return Lines(lines.values[::-1], lines.lit)


def test_the_finest_digit_may_be_too_fine_for_the_lens() -> None:
    pictures = [blurred(blurred(picture)) for picture in _digits("gray", inverse=True)]
    lines = _lines(pictures)
    assert lost_after(lines, range(14), _read(lines)) is None
    assert odd_pairs(lines, range(14), _read(lines)) == []


def test_a_picture_in_the_place_of_an_inverse_is_found_with_its_digit() -> None:
    pictures = _digits("gray", inverse=True)
    pictures[7] = pictures[4]
    lines = _lines(pictures)
    assert odd_pairs(lines, range(14), _read(lines)) == [(6, 7)]


def test_pictures_that_come_twice_are_found() -> None:
    pictures = _digits("gray", inverse=False)
    assert same_in_a_row(_lines(pictures)) == []
    other = _digits("gray", inverse=True)[6]
    assert same_in_a_row(_lines([*pictures[:4], other, *pictures[4:]])) == [(3, 4)]
