"""Calibrations by name, with settings from texts."""

from __future__ import annotations

import pytest

from dsl_core.campaign.recipes import _build, _value, load_recipe, recipe_names
from dsl_core.errors import CalibrationError
from tests.cases.fake_recipe import FakeRecipe


def test_every_recipe_has_its_name_and_needs_only_earlier_ones() -> None:
    names = recipe_names()
    for index, name in enumerate(names):
        recipe = load_recipe(name)
        assert recipe.name == name
        assert set(recipe.needs) <= set(names[:index])


def test_settings_are_read_from_text() -> None:
    kind = FakeRecipe
    built = _build(kind, "fake", {"keys": "day", "scale": "3", "bad_steps": '["day"]'})
    assert built == FakeRecipe(keys=("day",), scale=3.0, bad_steps={"day"})
    assert _build(kind, "fake", {"keys": "a,b"}).keys == ("a", "b")
    assert _build(kind, "fake", {"keys": ""}).keys == ()
    assert _value("430:460:15") == [430.0, 445.0, 460.0]
    with pytest.raises(CalibrationError, match="A setting of fake is wrong: scale must be a number"):
        _build(kind, "fake", {"scale": "large"})
