"""How long a reconstruction is expected to take."""

from __future__ import annotations

import pytest
from dsl_app.scan.reconstruction_time import Pace

from dsl_core.model.plan import CapturePlan
from dsl_core.model.presets import preset_plan
from dsl_core.planning.computing_time import computing_seconds


def plan_of(name: str, size_px: tuple[int, int]) -> CapturePlan:
    plan = preset_plan(name)
    assert plan is not None
    return plan.model_copy(update={"camera_size_px": size_px})


def test_the_pace_of_the_last_one_tells_the_next_of_any_plan_and_is_kept() -> None:
    kept: list[float] = []
    pace, full, small = Pace(1.0, kept.append), plan_of("preview", (890, 580)), plan_of("quick", (222, 145))
    assert pace.expected_s(full) == computing_seconds(full)
    pace.learn(small, 3 * computing_seconds(small))
    assert kept == [pytest.approx(3.0)]
    assert pace.expected_s(full) == pytest.approx(3 * computing_seconds(full))
    assert Pace(kept[0]).expected_s(small) == pytest.approx(3 * computing_seconds(small))


def test_what_was_disturbed_is_not_taken_for_the_pace() -> None:
    pace, plan = Pace(2.0), plan_of("quick", (222, 145))
    for seconds in (1e-6, 1e6):
        pace.learn(plan, seconds)
    assert pace.expected_s(plan) == pytest.approx(2 * computing_seconds(plan))
