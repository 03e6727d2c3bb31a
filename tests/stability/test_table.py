"""Every hard case ends as the table says, in single and in double precision."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.model.result import Flag, build_result
from tests.stability.case import PRECISIONS, Case, judge_scan, silent_values
from tests.stability.catalogue import PARTS
from tests.stability.table import as_wanted

CASES = [
    pytest.param(
        *(case, precision),
        id=f"{part}: {case.name}, {precision}",
        marks=[pytest.mark.slow] if part == "whole scans" else [],
    )
    for part, cases in PARTS.items()
    for case in cases
    for precision in PRECISIONS
]


@pytest.mark.parametrize(("case", "precision"), CASES)
def test_hard_case(case: Case, precision: str) -> None:
    outcome = case.outcome(PRECISIONS[precision])
    assert as_wanted(case, outcome), f"{outcome.ending}: {outcome.says}"


def test_cases_have_names_of_their_own() -> None:
    names = [(part, case.name) for part, cases in PARTS.items() for case in cases]
    assert len(names) == len(set(names))


def test_the_judge_sees_silence_dishonesty_and_flags() -> None:
    shape = (4, 5)
    arrays = {
        "depth_mm": np.full(shape, 700.0),
        "depth_std_mm": np.ones(shape),
        "reflectance": np.full((2, *shape), 0.5),
        "reflectance_std": np.full((2, *shape), 0.01),
        "flags": np.zeros(shape, np.uint16),
    }
    truth, depth = np.full((2, *shape), 0.51), np.full(shape, 700.5)
    result = build_result(arrays, np.array([500.0, 505.0]), {})
    assert judge_scan(result, truth, depth).ending == "right"
    assert judge_scan(result, truth + 0.02, depth).ending == "wrong"
    assert judge_scan(result, truth, depth + 3).ending == "wrong"
    result["flags"][:] = int(Flag.AT_BOUND)
    assert judge_scan(result, truth + 0.02, depth).says.startswith("AT_BOUND")
    result["flags"][:] = 0
    result["reflectance"][1, 2, 3] = np.inf
    assert silent_values(result) == ["reflectance"]
    assert judge_scan(result, truth, depth).ending == "wrong"
