"""A capture plan as one JSON file."""

from __future__ import annotations

from pathlib import Path

from dsl_core.errors import PlanError
from dsl_core.io.records import read_record, write_record
from dsl_core.model.plan import CapturePlan

#: Without any of these a file would mean the reference plan, which nobody who wrote it had in mind.
_ESSENTIAL = frozenset({"code", "settings", "spectral"})


def save_plan(plan: CapturePlan, path: Path, *, overwrite: bool = False) -> Path:
    """Write a plan, whole or not at all, and return its path; raises `StoreError`."""
    return write_record(path, plan, overwrite=overwrite)


def load_plan(path: Path) -> CapturePlan:
    """Read a plan; raises `PlanError` that names the fields that are wrong."""
    remedy = "Correct it, or write a new one with 'dsl-scan plan'."
    plan = read_record(
        path, CapturePlan, remedy, called="The plan", fault="is not valid", error=PlanError, most=3
    )
    if not plan.model_fields_set & _ESSENTIAL:
        raise PlanError(
            f"The plan {path} does not say what to capture: it has none of {', '.join(sorted(_ESSENTIAL))}."
            f" {remedy}"
        )
    return plan
