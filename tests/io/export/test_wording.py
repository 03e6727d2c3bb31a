"""Tables for people have the digits that are known, and say their origin without records of programs."""

from __future__ import annotations

import json

import pytest

from dsl_core.io.export.wording import deviation_text, figure_text, header_lines


@pytest.mark.parametrize(
    ("value", "std", "text"),
    [
        (0.30000001192, 0.0042, "0.30000"),
        (0.30000001192, float("nan"), "0.3"),
        (0.30000001192, 0.0, "0.3"),
        (700.1234, 0.11, "700.123"),
        (700.1234, 1e-9, "700.1234"),
        (-0.00001, 0.2, "-0.000"),
        (12345.6, 20000.0, "12346"),
        (0.0, 0.1, "0.0"),
        (float("nan"), 0.1, ""),
    ],
)
def test_a_figure_has_two_digits_more_than_its_deviation(value: float, std: float, text: str) -> None:
    assert figure_text(value, std) == text


def test_a_deviation_has_three_digits() -> None:
    assert [deviation_text(each) for each in (0.0042371, 12.3456, float("nan"))] == ["0.00424", "12.3", ""]


def test_an_origin_is_for_people() -> None:
    costs = json.dumps([{"name": "merge", "seconds": 1.5}])
    plan, options = json.dumps({"lines": 5, "name": "quick"}), json.dumps({"scene": "leaf", "size": "148x97"})
    told = {"rig": "twin", "stage_costs": costs, "capture_plan": plan, "options": options, "note": "[draft"}
    assert header_lines(told) == [
        "# rig: twin\n",
        "# options: scene leaf, size 148x97\n",
        "# note: [draft\n",
    ]
