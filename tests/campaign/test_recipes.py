"""Calibrations by name, with settings from texts."""

from __future__ import annotations

import pytest

from dsl_core.campaign.bandpass.recipe import BandpassRecipe
from dsl_core.campaign.common.recipe import AnyRecipe, Step
from dsl_core.campaign.depth_stage.recipe import DepthStageRecipe
from dsl_core.campaign.geometry.recipe import GeometryRecipe
from dsl_core.campaign.recipes import _build, _value, load_recipe, recipe_names
from dsl_core.campaign.spectralon.recipe import SpectralonRecipe
from dsl_core.errors import CalibrationError
from dsl_core.model.placement import Placement
from tests.cases.fake_recipe import FakeRecipe


def test_every_recipe_has_its_name_and_needs_only_earlier_ones() -> None:
    names = recipe_names()
    for index, name in enumerate(names):
        recipe = load_recipe(name)
        assert recipe.name == name
        assert set(recipe.needs) <= set(names[:index])


def test_light_is_measured_by_what_shows_it_without_a_filter() -> None:
    def light(recipe: AnyRecipe, key: str, filter_nm: float | None = None) -> bool:
        place = Placement(target="spectralon", film=True, filter_nm=filter_nm)
        return recipe.measures_light(Step(key, "It", "Do it.", place))

    assert [light(SpectralonRecipe(), key) for key in ("emission", "pictures")] == [False, True]
    assert [light(BandpassRecipe(), "plane"), light(BandpassRecipe(), "filter-450", 450.0)] == [True, False]
    assert light(DepthStageRecipe(), "plane-620")
    assert not light(DepthStageRecipe(chain=False), "plane-620")
    assert not light(DepthStageRecipe(), "filter-450", 450.0)
    assert not light(FakeRecipe(), "bright")


def test_settings_that_only_captures_heed_are_named_step_by_step() -> None:
    def heeded(recipe: AnyRecipe, key: str, filter_nm: float | None = None) -> dict[str, float]:
        place = Placement(target="spectralon", film=True, filter_nm=filter_nm)
        return recipe.acts_at_capture(Step(key, "It", "Do it.", place))

    assert heeded(BandpassRecipe(), "plane") == {}
    lines = {"line_px": 5, "long_ratio": 6.0}
    assert heeded(BandpassRecipe(long_ratio=6.0), "filter-450", 450.0) == lines
    assert heeded(DepthStageRecipe(), "plane-620") == {"code_step_px": 4}
    assert heeded(DepthStageRecipe(), "filter-450", 450.0) == {"filter_step_px": 16}
    assert heeded(SpectralonRecipe(readings=3), "emission") == {"readings": 3}
    assert heeded(SpectralonRecipe(emission_folder="spectra"), "emission") == {}
    assert heeded(SpectralonRecipe(), "pictures") == {}
    assert heeded(GeometryRecipe(ratio=2.0), "pose-01") == {"ratio": 2.0}


@pytest.mark.parametrize(
    ("name", "key", "text", "told"),
    [
        ("geometry", "ratio", "-1", "ratio must be at least 1"),
        ("geometry", "ratio", "nan", "ratio must be a finite number"),
        ("geometry", "poses", "2", "poses must be at least"),
        ("geometry", "poses", "100000", "poses must be at most 99"),
        ("selftest", "wanted_ms", "166,-7", "wanted_ms.1 must be greater than 0"),
        ("selftest", "wanted_ms", "nan", "wanted_ms.0 must be a finite number"),
        ("spectralon", "reflectance", "99", "reflectance must be at most 1.05"),
        ("spectralon", "reflectance", "0,99", "reflectance must be a number"),
        (
            "spectralon",
            "reflectance_rel_std",
            "0.5",
            "reflectance_rel_std must be less than 0.2",
        ),
        ("spectralon", "readings", "0", "readings must be at least 1"),
        ("spectralon", "depth_mm", "inf", "depth_mm must be a finite number"),
        ("color-checker", "depth_mm", "-1", "depth_mm must be greater than 0"),
        (
            "color-checker",
            "corners_px",
            "[[0,0],[1,0],[1,NaN],[0,1]]",
            "corners_px.2.1 must be a finite number",
        ),
        ("bandpass", "filters_nm", "430,5,450", "filters_nm.1 must be at least 300"),
        ("bandpass", "long_ratio", "0.5", "long_ratio must be at least 1"),
        ("bandpass", "line_px", "0", "line_px must be at least 1"),
        ("depth-stage", "stage_std_mm", "0", "stage_std_mm must be greater than 0"),
        ("depth-stage", "positions_mm", "620,nan", "positions_mm.1 must be a finite number"),
    ],
)
def test_a_setting_that_cannot_be_is_told_before_anything_is_captured(
    name: str, key: str, text: str, told: str
) -> None:
    with pytest.raises(CalibrationError, match=f"A setting of {name} is wrong: {told}"):
        load_recipe(name, {key: text})


def test_settings_at_their_bounds_are_taken() -> None:
    assert load_recipe("geometry", {"ratio": "1", "poses": "99"})
    assert load_recipe("spectralon", {"reflectance": "1.05", "depth_mm": "655"})
    assert load_recipe("depth-stage", {"positions_mm": "-3,0,5", "filters_nm": "450"})


@pytest.mark.parametrize("name", ["bandpass", "depth-stage"])
def test_the_target_is_the_spectralon_unless_another_one_is_stated(name: str) -> None:
    recipe, other = load_recipe(name), load_recipe(name, {"reflectance": "0.85"})
    assert isinstance(recipe, BandpassRecipe | DepthStageRecipe)
    assert isinstance(other, BandpassRecipe | DepthStageRecipe)
    assert (recipe.reflectance, other.reflectance) == (None, 0.85)


def test_settings_are_read_from_text() -> None:
    kind = FakeRecipe
    built = _build(kind, "fake", {"keys": "day", "scale": "3", "bad_steps": '["day"]'})
    assert built == FakeRecipe(keys=("day",), scale=3.0, bad_steps={"day"})
    assert _build(kind, "fake", {"keys": "a,b"}).keys == ("a", "b")
    assert _build(kind, "fake", {"keys": ""}).keys == ()
    assert _build(kind, "fake", {"keys": "none", "scale": ""}) == FakeRecipe()
    assert _value("430:460:15") == [430.0, 445.0, 460.0]
    with pytest.raises(CalibrationError, match="A setting of fake is wrong: scale must be a number"):
        _build(kind, "fake", {"scale": "large"})


@pytest.mark.parametrize("text", ["20261130", "white, 2026", "SRS-99,2020.csv", "0.99", "[1]", "430:450:10"])
def test_names_of_files_are_no_numbers_or_lists(text: str) -> None:
    assert load_recipe("spectralon", {"emission_folder": text}) == SpectralonRecipe(emission_folder=text)


@pytest.mark.parametrize("text", ["none", ""])
@pytest.mark.parametrize(
    ("name", "key"),
    [("color-checker", "corners_px"), ("bandpass", "depth_mm"), ("spectralon", "reflectance")],
)
def test_a_setting_is_taken_back_by_none(name: str, key: str, text: str) -> None:
    assert load_recipe(name, {key: text}) == load_recipe(name)


@pytest.mark.parametrize(("name", "key"), [("spectralon", "reflectance"), ("bandpass", "reflectance")])
def test_a_decimal_comma_is_told_as_one(name: str, key: str) -> None:
    with pytest.raises(CalibrationError, match=r"a decimal point, such as 0\.99 \(given 0,99\)"):
        load_recipe(name, {key: "0,99"})
