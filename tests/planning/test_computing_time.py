"""How long a reconstruction is expected to take, by what was measured."""

from __future__ import annotations

import pytest

from dsl_core.model.plan import CapturePlan
from dsl_core.model.presets import preset_plan
from dsl_core.planning.computing_time import CORES, START_S, computing_seconds

FULL, SMALL = (890, 580), (222, 145)


def plan_of(name: str, size_px: tuple[int, int]) -> CapturePlan:
    plan = preset_plan(name)
    assert plan is not None
    return plan.model_copy(update={"camera_size_px": size_px})


@pytest.mark.parametrize(
    ("name", "size_px", "measured_s"),
    [
        ("preview", FULL, 94.0),
        ("preview", SMALL, 9.3),
        ("comb", SMALL, 10.0),
        ("quick", FULL, 26.0),
        ("quick", SMALL, 5.9),
        ("coarse", FULL, 25.0),
        ("reference", FULL, 35.0),
    ],
)
def test_core_seconds_are_those_that_were_measured(
    name: str, size_px: tuple[int, int], measured_s: float
) -> None:
    assert CORES * computing_seconds(plan_of(name, size_px)) == pytest.approx(measured_s, rel=0.25)


def test_bands_count_once_for_lines_and_twice_for_combs() -> None:
    for name, power in (("quick", 1), ("comb", 2)):
        plan = plan_of(name, FULL)
        some, all_, more = (CORES * computing_seconds(plan, bands) - START_S for bands in (0, 47, 94))
        assert more - some == pytest.approx(2**power * (all_ - some))
