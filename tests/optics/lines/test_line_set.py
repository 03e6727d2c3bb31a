"""Scan lines and combs as equally spaced lines, and the frames that show them."""

from __future__ import annotations

import pytest
import torch

from dsl_core.model.plan import CapturePlan, GrayCode, LineComb, NoSpectral, ScanLines
from dsl_core.optics.lines.line_set import LineSet
from dsl_core.patterns.multiplexed import profile

LINES = LineSet(width_px=5, step_px=4, first_px=2.0, lines=10, frames=10)
COMB = LineSet(width_px=5, step_px=4, first_px=2.0, lines=10, frames=4)


def plan_of(spectral: ScanLines | LineComb | NoSpectral) -> CapturePlan:
    return CapturePlan(code=GrayCode(rows=False), spectral=spectral, projector_size_px=(98, 8))


@pytest.mark.parametrize(
    "spectral", [ScanLines(width_px=5, step_px=4), LineComb(width_px=6, step_px=4, period_px=24)]
)
def test_lines_are_where_patterns_show_them(spectral: ScanLines | LineComb) -> None:
    lines = LineSet.of(plan_of(spectral))
    assert lines is not None
    shown: list[set[float]] = []
    for pattern in range(lines.frames):
        light = profile(spectral, 98, pattern)[:, 0]
        starts = [x for x in range(98) if light[x] and (x == 0 or not light[x - 1])]
        shown.append({x + (spectral.width_px - 1) / 2 for x in starts})
    every = torch.arange(lines.lines)
    for line, centre, frame in zip(every, lines.centre_px(every), lines.frame(every), strict=True):
        assert float(centre) in shown[int(frame)], line
    assert lines.lines == 24, "a line cut off by the frame's edge counts as long as its middle is inside"
    assert lines.single == isinstance(spectral, ScanLines)


def test_other_patterns_are_no_lines() -> None:
    assert LineSet.of(plan_of(NoSpectral())) is None
    assert LineSet.of(plan_of(LineComb(width_px=6, step_px=4, period_px=24, shifts_px=(0, 8, 16)))) is None
    assert LineSet.of(plan_of(LineComb(width_px=6, step_px=5, period_px=24))) is None


def test_lines_near_some_columns_and_one_more_on_either_side() -> None:
    assert LINES.near(10.5, 17.5) == range(2, 5)
    assert LINES.near(10.0, 18.0) == range(2, 5)
    assert LINES.near(-50.0, 3.0) == range(0, 2)
    assert LINES.near(30.0, 500.0) == range(7, 10)


def test_frames_repeat_over_lines_of_a_comb_and_stay_within_the_set() -> None:
    line = torch.tensor([-3, 0, 3, 5, 9, 10, 12])
    assert LINES.frame(line).tolist() == [0, 0, 3, 5, 9, 9, 9]
    assert COMB.frame(line).tolist() == [0, 0, 3, 1, 1, 1, 1]
    assert COMB.exists(line).tolist() == [False, True, True, True, True, False, False]


def test_the_nearest_line_of_columns() -> None:
    columns = torch.tensor([2.0, 3.9, 4.1, -3.0, 60.0])
    assert LINES.nearest(columns).tolist() == [0, 0, 1, -1, 14]
    assert LINES.position(8.0) == 1.5
