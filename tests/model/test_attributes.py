"""Attributes of a result that nobody can read say nothing, and keep nobody from the rest."""

from __future__ import annotations

import pytest

from dsl_core.model.attributes import PLAN_ATTRIBUTE, plan_of, sentences_of
from dsl_core.model.plan import CapturePlan


@pytest.mark.parametrize("text", ["", "5", "[", "[" * 5000, "NaN", 5.0, None, '{"settings": 5}'])
def test_what_is_no_list_or_plan_is_none(text: object) -> None:
    assert sentences_of({"doubts": text}, "doubts") == ()
    assert plan_of({PLAN_ATTRIBUTE: text}) is None


def test_what_is_there_is_read() -> None:
    assert sentences_of({"doubts": '["Frame 3 is late.", 5]'}, "doubts") == ("Frame 3 is late.", "5")
    assert sentences_of({}, "doubts") == ()
    plan = CapturePlan(camera_size_px=(12, 8))
    assert plan_of({PLAN_ATTRIBUTE: plan.model_dump_json()}) == plan
    assert plan_of({}) is None
