"""First answers as scripts ask for them."""

from __future__ import annotations

from typing import Any

import pytest

import dsl_core as dsl
from dsl_core.errors import DecodeError
from tests.cases.small_result import small_result

PINS = {"a": (1, 1, 3, 2), "b": (6, 3)}


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"brightness": "Free"}, "brightness of a classification is stated or free, not 'Free'"),
        ({"brightness": True}, "brightness of a classification is stated or free, not True"),
        ({"measure": "cosine"}, "measure of a classification is probability or angle or rmse, not 'cosine'"),
        ({"measure": ["angle"]}, "measure of a classification is"),
    ],
)
def test_a_choice_that_there_is_not_is_told_with_those_that_there_are(
    wrong: dict[str, Any], words: str
) -> None:
    with pytest.raises(DecodeError, match=words):
        dsl.classify(small_result(), pins=PINS, **wrong)


@pytest.mark.parametrize("name", ["none of these", "undecided", "not judged"])
def test_no_class_takes_the_name_of_pixels_without_one(name: str) -> None:
    with pytest.raises(DecodeError, match=f"No class can be called '{name}'.*Rename it"):
        dsl.classify(small_result(), pins={name: PINS["a"], "b": PINS["b"]}, measure="angle")
