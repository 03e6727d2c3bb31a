"""First answers as scripts ask for them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import dsl_core as dsl
from dsl_core.errors import CalibrationError, DecodeError
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


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"worst": "a"}, "limit 'worst' must be a number of at least 0, not 'a'"),
        ({"margin": (0.5, 0.6)}, "limit 'margin' must be a number of at least 0, not"),
        ({"pins": [(1, 3)]}, "Places are given by names, .*; given a list"),
        ({"pins": np.array([(1, 3)])}, "Places are given by names, .*; given a ndarray"),
        ({"range_nm": (500,)}, r"range_nm is two wavelengths in nm, .*; given \(500,\)"),
        ({"range_nm": 500}, "range_nm is two wavelengths in nm, .*; given 500"),
        ({"range_nm": ("a", "b")}, "range_nm is two wavelengths in nm"),
    ],
)
def test_what_is_no_limit_place_or_range_is_told(wrong: dict[str, Any], words: str) -> None:
    with pytest.raises(DecodeError, match=words):
        dsl.classify(small_result(), **{"pins": PINS, **wrong})


@pytest.mark.parametrize("given", [None, "x", -1, float("nan")])
def test_the_error_of_a_library_is_a_share(given: Any, tmp_path: Path) -> None:
    rows = "".join(f"{nm},0.5\n" for nm in range(400, 710, 10))
    (tmp_path / "a.csv").write_text(f"nm,a\n{rows}", encoding="utf-8")
    with pytest.raises(CalibrationError, match="error of a library is a share from 0 to 1, not"):
        dsl.classify(small_result(), tmp_path / "a.csv", library_error=given)


@pytest.mark.parametrize("lights", [(), None, 5, [["D65"]]])
def test_lights_are_given_by_names(lights: Any) -> None:
    with pytest.raises(DecodeError, match=r"Lights are given by names, .*; given"):
        dsl.colours(small_result(), PINS, lights)


def test_lights_may_come_from_a_generator() -> None:
    result = small_result().interp(wavelength_nm=range(430, 661, 5))
    found = dsl.colours(result, PINS, (each for each in ("A", "D65")))  # type: ignore[arg-type]
    assert found["light"].values.tolist() == ["A", "D65"]


def test_places_of_colours_are_given_by_names() -> None:
    with pytest.raises(DecodeError, match=r"Places are given by names, .*; given a NoneType"):
        dsl.colours(small_result(), None)  # type: ignore[arg-type]


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
