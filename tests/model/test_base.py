from __future__ import annotations

import pytest
from pydantic import ValidationError

from dsl_core.model.base import problems_in_words
from dsl_core.model.plan import CapturePlan


def test_the_first_wrong_fields_are_named() -> None:
    with pytest.raises(ValidationError) as caught:
        CapturePlan.model_validate_json('{"camera_size_px": [0], "name": 3}')
    first, second = problems_in_words(caught.value, 2).split("; ")
    assert first == problems_in_words(caught.value)
    assert {first.split(":")[0], second.split(":")[0]} == {"camera_size_px.1", "name"}
    assert "Input should be a valid string" in f"{first} {second}"


def test_what_is_no_record_at_all_is_the_file() -> None:
    with pytest.raises(ValidationError) as caught:
        CapturePlan.model_validate_json("{")
    assert problems_in_words(caught.value).startswith("the file: Invalid JSON")


@pytest.mark.parametrize("length", [37, 38, 39, 200])
def test_long_values_are_cut_to_forty_characters(length: int) -> None:
    with pytest.raises(ValidationError) as caught:
        CapturePlan.model_validate({"settings": "x" * length})
    told = problems_in_words(caught.value).split("(given ")[1].removesuffix(")")
    whole = repr("x" * length)
    assert told == (whole if len(whole) <= 40 else whole[:37] + "...")
    assert len(told) <= 40
