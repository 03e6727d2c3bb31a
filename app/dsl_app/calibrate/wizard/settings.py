"""The settings of a recipe as rows of text, and what its docstring says about each. No Qt."""

from __future__ import annotations

import inspect
import json
import re
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Any

from pydantic import BaseModel

from dsl_app.calibrate.setting_words import setting_title
from dsl_app.calibrate.wizard.state import SettingRow
from dsl_core.campaign.common.recipe import AnyRecipe
from dsl_core.model.placement import Placement
from dsl_core.words import capitalised

#: As many values of a list are named one by one.
MOST_LISTED = 4


def setting_rows(
    recipe: AnyRecipe, settings: Mapping[str, str], placement: Placement | None = None
) -> tuple[SettingRow, ...]:
    """A row for each field of a recipe, with the value in the campaign or its default.

    A field that is empty by default has what the ``placement`` of the first step uses in its stead.
    """
    kind: type[Any] = type(recipe)
    if not is_dataclass(kind):
        return ()
    plain = kind()
    found, options = [], {} if placement is None else placement.options
    for each in fields(kind):
        default = getattr(plain, each.name)
        text = as_text(default)
        found.append(
            SettingRow(
                each.name,
                _kind(default),
                text,
                settings.get(each.name, text),
                _doc(kind, each.name),
                as_text(options.get(each.name)),
                "" if each.name not in settings else _understood(getattr(recipe, each.name)),
            )
        )
    return tuple(found)


def changed_settings(rows: tuple[SettingRow, ...], values: Mapping[str, str]) -> dict[str, str]:
    """What the campaign has to remember: the settings that are not at their defaults."""
    texts = {row.key: values.get(row.key, row.value).strip() for row in rows}
    return {row.key: texts[row.key] for row in rows if texts[row.key] != row.default}


def as_text(value: Any) -> str:
    """A value as the command line's ``--set`` takes it, in six digits: a default that stays is not rounded.

    >>> as_text((430.0, 440.0)), as_text(500 / 3), as_text(True), as_text(""), as_text(None)
    ('430,440', '166.667', 'true', '', '')
    """
    match value:
        case None:
            return ""
        case bool():
            return json.dumps(value)
        case float():
            return f"{value:.6g}"
        case BaseModel():
            return value.model_dump_json()
        case tuple() if all(isinstance(each, int | float | str) for each in value):
            return ",".join(as_text(each) for each in value)
        case tuple():
            return json.dumps(value)
    return str(value)


def _understood(value: Any) -> str:
    """How a list of numbers was read, as a sentence; empty for anything else.

    >>> _understood((166.0, 7.0)), _understood((430.0, 440.0, 450.0, 460.0, 470.0)), _understood((0.5,))
    ('Read as 2 values: 166 and 7.', 'Read as 5 values from 430 to 470.', '')
    """
    if not isinstance(value, tuple) or len(value) < 2 or not all(isinstance(each, float) for each in value):
        return ""
    texts = [as_text(each) for each in value]
    if len(texts) > MOST_LISTED:
        return f"Read as {len(texts)} values from {as_text(min(value))} to {as_text(max(value))}."
    return f"Read as {len(texts)} values: {', '.join(texts[:-1])} and {texts[-1]}."


def _kind(value: Any) -> str:
    match value:
        case bool():
            return "switch"
        case BaseModel():
            return "board"
    return "text"


def _doc(kind: type[Any], name: str) -> str:
    """What the class's docstring says of a field, as a sentence of its own; empty when it says nothing."""
    text = " ".join((inspect.getdoc(kind) or "").split())
    for sentence in re.split(r"(?<=\.)\s+(?=[`A-Z])|;\s+", text):
        _, found, rest = sentence.partition(f"``{name}``")
        if not found:
            continue
        # Up to where the sentence turns to another field.
        own = re.split(r",?\s+(?:or|and)?\s*``\w+``", rest)[0]
        plain = re.sub(r"^(?:is|are)\s+", "", own.replace("``", "").strip(" ,.;"))
        if not plain:
            plain = sentence.replace(f"``{name}``", "this").strip(" ,.;")
        return f"{capitalised(plain)}."
    return ""


def trouble_in_titles(text: str, name: str) -> str:
    """What is wrong with a setting of the calibration ``name``, called as the window calls the setting.

    >>> trouble_in_titles("A setting of spectralon is wrong: depth_mm must be a number.", "spectralon")
    'Distance of the target (mm) must be a number.'
    >>> trouble_in_titles("A setting of geometry is wrong: board.columns must be 3.", "geometry")
    'Board: columns must be 3.'
    >>> trouble_in_titles("A setting of bandpass is wrong: depth_mm.1 must be 3 (given 5).", "bandpass")
    'Distance of the target (mm) must be 3 (given 5).'
    """
    wrong = text.removeprefix(f"A setting of {name} is wrong: ")
    # The number of a value in a list counts from 0; which one it is, is seen.
    found = re.match(r"(\w+)(?:\.\d+\b)*(\.?)", wrong)
    if wrong == text or found is None:
        return text
    return setting_title(found[1]) + ": " * bool(found[2]) + wrong[found.end() :]
