"""The settings of a recipe as rows: texts, kinds, what its docstring says, and what the campaign keeps."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, cast

import pytest
from dsl_app.calibrate.setting_words import TITLES, setting_title
from dsl_app.calibrate.wizard.settings import (
    as_text,
    changed_settings,
    setting_rows,
)

from dsl_core.campaign.common.recipe import AnyRecipe
from dsl_core.campaign.recipes import load_recipe, recipe_names
from dsl_core.model.board import Board, Checkerboard
from dsl_core.model.placement import Placement


@dataclass
class Recipe:
    """A recipe of a test.

    ``board`` is the printed board; ``filters_nm`` are the filters, in nm, and ``is_slow`` whether to wait.
    ``left_out`` are steps that the fit does without; their captures are kept.
    """

    board: Board = field(default_factory=lambda: Checkerboard(columns=9, rows=6, square_mm=25.0))
    filters_nm: tuple[float, ...] = (430.0, 500 / 3)
    is_slow: bool = False
    left_out: tuple[str, ...] = ()
    silent: int | None = None


ROWS = {row.key: row for row in setting_rows(cast(AnyRecipe, Recipe()), {"is_slow": "true"})}


def test_every_field_is_a_row_with_its_default_and_value() -> None:
    assert list(ROWS) == ["board", "filters_nm", "is_slow", "left_out", "silent"]
    assert [row.kind for row in ROWS.values()] == ["board", "text", "switch", "text", "text"]
    assert ROWS["board"].default.startswith('{"kind":"checkerboard","columns":9')
    assert (ROWS["filters_nm"].default, ROWS["filters_nm"].value) == ("430,166.667", "430,166.667")
    assert (ROWS["is_slow"].default, ROWS["is_slow"].value) == ("false", "true")


def test_what_the_rig_decides_is_shown_where_a_field_is_empty() -> None:
    where = Placement(options={"silent": 700.0})
    rows = {row.key: row for row in setting_rows(cast(AnyRecipe, Recipe()), {}, where)}
    assert (rows["silent"].default, rows["silent"].used) == ("", "700")
    assert rows["filters_nm"].used == ""


def test_a_list_says_how_it_was_read() -> None:
    recipe = load_recipe("selftest", {"wanted_ms": "166,7"})
    (row,) = setting_rows(recipe, {"wanted_ms": "166,7"})
    assert row.understood == "Read as 2 values: 166 and 7."
    (row,) = setting_rows(load_recipe("selftest"), {})
    assert row.understood == "", "a default was not typed"


def test_rows_are_explained_by_the_docstring() -> None:
    assert ROWS["board"].doc == "The printed board."
    assert ROWS["filters_nm"].doc == "The filters, in nm."
    assert ROWS["is_slow"].doc == "Whether to wait."
    assert ROWS["left_out"].doc == "Steps that the fit does without."
    assert ROWS["silent"].doc == ""


def test_every_setting_of_the_installed_calibrations_is_explained() -> None:
    from dsl_core.campaign.recipes import load_recipe

    for name in recipe_names():
        rows = setting_rows(load_recipe(name, {}), {})
        assert [(name, row.key) for row in rows if not row.doc] == []


def test_the_campaign_keeps_what_is_not_at_its_default() -> None:
    rows = tuple(ROWS.values())
    assert changed_settings(rows, {}) == {"is_slow": "true"}
    changed = changed_settings(rows, {"is_slow": "false", "left_out": " a,b "})
    assert changed == {"left_out": "a,b"}


@pytest.mark.parametrize(
    ("value", "text"),
    [
        ((430.0, 440.0), "430,440"),
        (500 / 3, "166.667"),
        (True, "true"),
        (None, ""),
        (((1.0, 2.0), (3.0, 4.0)), "[[1.0, 2.0], [3.0, 4.0]]"),
        ("white", "white"),
    ],
)
def test_values_as_the_command_line_takes_them(value: Any, text: str) -> None:
    assert as_text(value) == text


def test_titles_name_their_unit() -> None:
    titles = [setting_title(key) for key in ("long_nm", "tilt_deg", "board", "nm")]
    assert titles == ["Long (nm)", "Tilt (°)", "Board", "Nm"]


def test_every_setting_of_every_calibration_has_its_title_in_words() -> None:
    keys = {row.key for name in recipe_names() for row in setting_rows(load_recipe(name), {})}
    assert keys - set(TITLES) == {"board"}
    assert set(TITLES) - keys == set()
