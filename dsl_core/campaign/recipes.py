"""All calibrations in their order, loaded when they are requested."""

from __future__ import annotations

import importlib
import importlib.util
import re
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import TYPE_CHECKING, Any, get_args, get_origin, get_type_hints

from dsl_core.campaign.common.recipe import AnyRecipe
from dsl_core.errors import CalibrationError
from dsl_core.model.base import problems_in_words

if TYPE_CHECKING:
    from dsl_core.io.campaign_folder import CampaignFolder

#: Film off first, so that the film is mounted once.
_CLASSES = {
    "selftest": "SelfTestRecipe",
    "geometry": "GeometryRecipe",
    "spectralon": "SpectralonRecipe",
    "color-checker": "ColorCheckerRecipe",
    "bandpass": "BandpassRecipe",
    "depth-stage": "DepthStageRecipe",
}


def recipe_names() -> tuple[str, ...]:
    """The calibrations of this installation, in the order in which they build on each other."""
    return tuple(name for name in _CLASSES if importlib.util.find_spec(_module(name)) is not None)


def load_recipe(name: str, settings: Mapping[str, str] | None = None) -> AnyRecipe:
    """The calibration of a name with its settings; raises `CalibrationError` for either that is unknown."""
    if name not in recipe_names():
        raise CalibrationError(f"There is no calibration {name!r}; choose {', '.join(recipe_names())}.")
    kind = getattr(importlib.import_module(_module(name)), _CLASSES[name])
    recipe: AnyRecipe = _build(kind, name, settings or {})
    return recipe


def campaign_recipes(campaign: CampaignFolder) -> tuple[AnyRecipe, ...]:
    """Every calibration of this installation with the campaign's settings, in order."""
    return tuple(load_recipe(name, campaign.info.settings.get(name)) for name in recipe_names())


def _module(name: str) -> str:
    return f"dsl_core.campaign.{name.replace('-', '_')}.recipe"


def _build(kind: type[Any], name: str, settings: Mapping[str, str]) -> Any:
    """A recipe from texts, each read as `_value` does; a value stands for a list of one.

    ``none``, and no text for what is not a list, is the usual value; texts of files and folders are taken as
    they are.
    """
    from pydantic import TypeAdapter, ValidationError

    known = {field.name for field in fields(kind)} if is_dataclass(kind) else set()
    unknown = [key for key in settings if key not in known]
    if unknown:
        raise CalibrationError(
            f"{name} has no setting {', '.join(unknown)}; it has {', '.join(sorted(known)) or 'none'}."
        )
    if not settings:
        return kind()
    try:
        types = get_type_hints(kind)
        lists = {key for key in settings if get_origin(types[key]) is tuple}
        usual = {key for key, text in settings.items() if text == "none" or (not text and key not in lists)}
        given = {key: text for key, text in settings.items() if key not in usual}
        values = {key: text if types[key] is str else _value(text) for key, text in given.items()}
        for key, value in values.items():
            if key in lists:
                values[key] = value if isinstance(value, list) else [value] if value != "" else []
            elif float in (types[key], *get_args(types[key])) and re.fullmatch(r"-?\d+,\d+", given[key]):
                raise CalibrationError(
                    f"A setting of {name} is wrong: {key} must be a number with a decimal point, such as"
                    f" {given[key].replace(',', '.')} (given {given[key]})."
                )
        return TypeAdapter(kind).validate_python(values)
    except ValidationError as error:
        raise CalibrationError(f"A setting of {name} is wrong: {problems_in_words(error)}.") from error


def _value(text: str) -> Any:
    """JSON where it is JSON, a list where there are commas or START:STOP:STEP, else the text itself.

    >>> _value("430,450"), _value("430:450:10"), _value("0.99"), _value("center")
    ([430, 450], [430.0, 440.0, 450.0], 0.99, 'center')
    """
    import json

    if re.fullmatch(r"[\d.]+:[\d.]+:[\d.]+", text):
        start, stop, step = (float(part) for part in text.split(":"))
        return [start + step * i for i in range(int((stop - start) / step + 1.001))] if step > 0 else text
    try:
        return json.loads(text)
    except ValueError:
        return [_value(part) for part in text.split(",")] if "," in text else text
