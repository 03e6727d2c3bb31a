"""Common ground of all records: frozen, strict, finite, JSON, and sentences about what a record refuses."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pydantic import BaseModel, ConfigDict, ValidationError


class Record(BaseModel):
    """A frozen, validated record that round-trips through JSON and rejects unknown fields."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


#: What a value must be, by the validator's name of the fault; braces stand for what the fault tells.
_WANTED = {
    "bool_parsing": "must be true or false",
    "bool_type": "must be true or false",
    "dict_type": "must be an object with named fields",
    "enum": "must be one of {expected}",
    "finite_number": "must be a finite number",
    "float_parsing": "must be a number",
    "float_type": "must be a number",
    "greater_than": "must be greater than {gt}",
    "greater_than_equal": "must be at least {ge}",
    "int_from_float": "must be a whole number",
    "int_parsing": "must be a whole number",
    "int_type": "must be a whole number",
    "less_than": "must be less than {lt}",
    "less_than_equal": "must be at most {le}",
    "list_type": "must be a list",
    "literal_error": "must be {expected}",
    "missing": "is missing",
    "extra_forbidden": "is not a field of it",
    "model_type": "must be an object with named fields",
    "multiple_of": "must be a multiple of {multiple_of}",
    "string_pattern_mismatch": "must be of the form {pattern}",
    "string_too_short": "must have at least {min_length} characters",
    "string_type": "must be a text",
    "too_long": "must have at most {max_length} values",
    "too_short": "must have at least {min_length} values",
    "tuple_type": "must be a list",
    "union_tag_invalid": "must have one of the kinds {expected_tags}",
    "union_tag_not_found": "must say its {discriminator}",
}


def what_is_wrong(fault: Mapping[str, Any]) -> str:
    """What a value must be, of an entry of ``ValidationError.errors()``, as words after the field's name.

    Checks of our own say it themselves.
    """
    wanted = _WANTED.get(fault["type"])
    if wanted is None:
        return str(fault["msg"]).removeprefix("Value error, ").removeprefix("Assertion failed, ")
    told = fault.get("ctx", {})
    return wanted.format_map({k: f"{v:g}" if isinstance(v, float) else v for k, v in told.items()})


def problems_in_words(error: ValidationError, most: int = 1, whole: str = "the file") -> str:
    """The first fields of a record that are wrong, as ``name.of.field must be such (given value)``.

    ``whole`` is what the record is called where no single field of it is to blame.
    """
    return "; ".join(_problem(fault, whole) for fault in error.errors()[:most])


def _problem(fault: Mapping[str, Any], whole: str) -> str:
    where = ".".join(map(str, fault["loc"])) or whole
    words = what_is_wrong(fault)
    if fault["type"] == "missing":
        return f"{where} {words}"
    colon = "" if fault["type"] in _WANTED else ":"
    return f"{where}{colon} {words} (given {_short(fault['input'])})"


def _short(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 40 else text[:37] + "..."
