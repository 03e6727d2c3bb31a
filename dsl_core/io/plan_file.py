"""A capture plan as one JSON file."""

from __future__ import annotations

from pathlib import Path

from pydantic import ValidationError

from dsl_core.errors import PlanError
from dsl_core.io.staging import write_record
from dsl_core.model.base import problems_in_words
from dsl_core.model.plan import CapturePlan

_MOST_PROBLEMS = 3


def save_plan(plan: CapturePlan, path: Path, *, overwrite: bool = False) -> Path:
    """Write a plan, whole or not at all, and return its path; raises `StoreError`."""
    return write_record(path, plan, overwrite=overwrite)


def load_plan(path: Path) -> CapturePlan:
    """Read a plan; raises `PlanError` that names every field that is wrong."""
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise PlanError(f"The plan {path} cannot be read ({error}). 'dsl-scan plan' writes one.") from error
    try:
        return CapturePlan.model_validate_json(text)
    except ValidationError as error:
        raise PlanError(
            f"The plan {path} is not valid: {problems_in_words(error, _MOST_PROBLEMS)}."
            " Correct it, or write a new one with 'dsl-scan plan'."
        ) from error
