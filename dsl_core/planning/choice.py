"""The plan that answers a wish: the most accurate within a budget, or the quickest that is good enough."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from dsl_core.errors import PlanError
from dsl_core.model.plan import CapturePlan
from dsl_core.model.rig import Rig
from dsl_core.planning.prediction import Prediction, predict
from dsl_core.planning.views import View, plane_view
from dsl_core.progress import NoProgress, Progress
from dsl_core.solve.front import front


@dataclass(frozen=True)
class Weighed:
    """A plan and what is expected of it."""

    plan: CapturePlan
    expected: Prediction


def weigh(
    rig: Rig,
    plans: Iterable[CapturePlan],
    view: View | None = None,
    *,
    latency_ms: float = 0.0,
    budget_s: float | None = None,
    progress: Progress | None = None,
) -> list[Weighed]:
    """Predict every plan that takes no longer than the budget."""
    progress = progress or NoProgress()
    view = view or plane_view(rig)
    todo = [plan for plan in plans if budget_s is None or plan.duration_s(latency_ms) <= budget_s]
    found = []
    for done, plan in enumerate(todo, 1):
        found.append(Weighed(plan, predict(rig, plan, view, latency_ms=latency_ms, peaks=False)))
        progress.report("plans", done, len(todo))
    return found


def pareto(weighed: Sequence[Weighed]) -> list[Weighed]:
    """The plans worth their time: none is both quicker and more accurate."""
    points = [(each.expected.seconds, each.expected.pixel_rmse) for each in weighed]
    return [weighed[i] for i in front(points)]


def choose(weighed: Sequence[Weighed], budget_s: float | None = None, error: float | None = None) -> Weighed:
    """The quickest plan with at most ``error`` (pixel RMSE), or the most accurate within the budget.

    Raises `PlanError` that says what could be had.
    """
    able = [each for each in weighed if budget_s is None or each.expected.seconds <= budget_s]
    if not able:
        raise PlanError(
            f"No plan takes at most {budget_s:g} s on this rig. Allow more time, or lower its latency."
        )
    best = min(able, key=lambda each: each.expected.pixel_rmse)
    if error is None:
        return best
    good = [each for each in able if each.expected.pixel_rmse <= error]
    if not good:
        raise PlanError(
            f"No plan is expected to reach a reflectance error of {error:g}; the best,"
            f" {best.plan.name!r}, reaches {best.expected.pixel_rmse:.4f} in {best.expected.seconds:.0f} s."
        )
    return min(good, key=lambda each: each.expected.seconds)
