"""What the report of a result says, gathered from the result itself."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

from dsl_core.evaluation.cost import StageCost
from dsl_core.evaluation.rendered_effects import RenderedEffects
from dsl_core.evaluation.report.scan_report import ReportContent
from dsl_core.evaluation.summary import Evaluation, Truth
from dsl_core.evaluation.verdict import Goal, verdicts
from dsl_core.model.plan import CapturePlan

if TYPE_CHECKING:
    import xarray as xr


def report_content(
    title: str,
    result: xr.Dataset,
    truth: Truth,
    evaluation: Evaluation,
    summary: str = "",
    goals: dict[str, Goal] | None = None,
) -> ReportContent:
    """What the report of a result says; plan and costs come from the result's attributes."""
    attributes = dict(result.attrs)
    costs = [StageCost(**cost) for cost in json.loads(attributes.pop("stage_costs", "[]"))]
    plan = attributes.pop("capture_plan", None)
    effects = RenderedEffects.of_note(str(attributes.get("effects", "")))
    if effects is not None:
        del attributes["effects"]
    return ReportContent(
        title,
        result,
        summary=summary,
        evaluation=evaluation,
        truth=truth,
        verdicts=verdicts(evaluation, goals),
        costs=costs,
        plan=CapturePlan.model_validate_json(plan) if plan else None,
        effects=effects,
        provenance={str(key).replace("_", " "): str(value) for key, value in attributes.items()},
    )
