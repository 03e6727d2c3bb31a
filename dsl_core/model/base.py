"""Common ground of all records: frozen, strict, finite, JSON."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict, ValidationError


class Record(BaseModel):
    """A frozen, validated record that round-trips through JSON and rejects unknown fields."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


def problems_in_words(error: ValidationError, most: int = 1) -> str:
    """The first fields of a record that are wrong, as ``name.of.field: reason (given value)``."""
    problems = [
        f"{'.'.join(map(str, item['loc'])) or 'the file'}: {item['msg'].removeprefix('Value error, ')}"
        f" (given {_short(item['input'])})"
        for item in error.errors()[:most]
    ]
    return "; ".join(problems)


def _short(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 40 else text[:37] + "..."
