"""What attributes of a result hold as JSON: results come from strangers too, so nothing is taken on trust."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from pydantic import ValidationError

from dsl_core.model.plan import CapturePlan

#: Name of the attribute that holds the plan by which a result's frames were captured.
PLAN_ATTRIBUTE = "capture_plan"
#: Name of that which is the relative deviation of all reflectances together, which no pixel shows.
SCALE_ATTRIBUTE = "reflectance_scale_rel_std"
#: Name of that which lists sentences about pictures that do not show their pattern.
DOUBTS = "frames_in_doubt"


def sentences_of(attributes: Mapping[Any, Any], name: str) -> tuple[str, ...]:
    """The sentences that an attribute lists, none where there are none that can be read."""
    try:
        found = json.loads(str(attributes.get(name, "[]")))
    except (ValueError, RecursionError):
        return ()
    return tuple(map(str, found)) if isinstance(found, list) else ()


def plan_of(attributes: Mapping[Any, Any]) -> CapturePlan | None:
    """The plan by which the frames were captured; None where there is none, or none that can be read."""
    try:
        return CapturePlan.model_validate_json(str(attributes.get(PLAN_ATTRIBUTE, "")))
    except ValidationError:
        return None
