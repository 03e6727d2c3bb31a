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


def test_a_band_that_no_pixel_has_is_left_out_and_told() -> None:
    whole = small_result()
    masked = whole.assign(reflectance=whole["reflectance"].where(whole["wavelength_nm"] != 550))
    found = dsl.classify(masked, pins=PINS, measure="angle")
    without = dsl.classify(whole.sel(wavelength_nm=[430, 432.5, 655, 660]), pins=PINS, measure="angle")
    assert found["pixels"].values.tolist() == without["pixels"].values.tolist()
    assert found.attrs["notes"][-1] == "550 nm: left out, as no pixel has a reflectance there."


def test_pixels_that_lack_bands_are_told_apart_from_those_without_a_spectrum() -> None:
    whole = small_result()
    holes = whole["reflectance"].copy()
    holes[2, :, 5:] = holes[1, :, :5] = float("nan")
    with pytest.raises(DecodeError, match="a: none of its 6 pixels has all 5 bands"):
        dsl.classify(whole.assign(reflectance=holes), pins=PINS, measure="angle")
