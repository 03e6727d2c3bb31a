from __future__ import annotations

from typing import Literal

import pytest
from pydantic import Field, ValidationError

from dsl_core.model.base import Record, problems_in_words
from dsl_core.model.plan import CapturePlan


def test_the_first_wrong_fields_are_named() -> None:
    with pytest.raises(ValidationError) as caught:
        CapturePlan.model_validate_json('{"camera_size_px": [0], "name": 3}')
    first, second = problems_in_words(caught.value, 2).split("; ")
    assert first == problems_in_words(caught.value)
    assert {first.split(" ")[0], second.split(" ")[0]} == {"camera_size_px.1", "name"}
    assert "must be a text (given 3)" in f"{first} {second}"


def test_what_is_no_record_at_all_is_the_file() -> None:
    with pytest.raises(ValidationError) as caught:
        CapturePlan.model_validate_json("{")
    assert problems_in_words(caught.value).startswith("the file: Invalid JSON")


class _Everything(Record):
    """A field for each kind of check."""

    choice: Literal["a", "b"] = "a"
    few: tuple[float, ...] = Field((1.0, 2.0), min_length=2, max_length=3)
    flag: bool = True
    form: str = Field("ab", pattern=r"^[a-z]+$")
    inner: dict[str, float] = Field(default_factory=dict)
    least: float = Field(1.0, ge=1.0)
    most: int = Field(1, le=9)
    name: str = Field("name", min_length=3)
    needed: int
    over: float = Field(1.0, gt=0.0)
    under: float = Field(1.0, lt=2.0)


@pytest.mark.parametrize(
    ("field", "given", "words"),
    [
        ("choice", "c", "choice must be 'a' or 'b' (given 'c')"),
        ("few", [1], "few must have at least 2 values (given [1])"),
        ("few", [1, 2, 3, 4], "few must have at most 3 values (given [1, 2, 3, 4])"),
        ("few", [1, "x"], "few.1 must be a number (given 'x')"),
        ("flag", "maybe", "flag must be true or false (given 'maybe')"),
        ("form", "A", "form must be of the form ^[a-z]+$ (given 'A')"),
        ("inner", 3, "inner must be an object with named fields (given 3)"),
        ("least", 0, "least must be at least 1 (given 0)"),
        ("least", float("nan"), "least must be a finite number (given nan)"),
        ("most", 10, "most must be at most 9 (given 10)"),
        ("most", 1.5, "most must be a whole number (given 1.5)"),
        ("name", "n", "name must have at least 3 characters (given 'n')"),
        ("over", 0, "over must be greater than 0 (given 0)"),
        ("under", 2, "under must be less than 2 (given 2)"),
        ("other", 1, "other is not a field of it (given 1)"),
    ],
)
def test_faults_are_told_in_words_of_ours(field: str, given: object, words: str) -> None:
    with pytest.raises(ValidationError) as caught:
        _Everything.model_validate({"needed": 1, field: given})
    assert problems_in_words(caught.value) == words
    with pytest.raises(ValidationError) as caught:
        _Everything.model_validate({})
    assert problems_in_words(caught.value) == "needed is missing"


@pytest.mark.parametrize("length", [37, 38, 39, 200])
def test_long_values_are_cut_to_forty_characters(length: int) -> None:
    with pytest.raises(ValidationError) as caught:
        CapturePlan.model_validate({"settings": "x" * length})
    told = problems_in_words(caught.value).split("(given ")[1].removesuffix(")")
    whole = repr("x" * length)
    assert told == (whole if len(whole) <= 40 else whole[:37] + "...")
    assert len(told) <= 40
