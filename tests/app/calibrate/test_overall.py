"""How far everything is, and the time left, by the parts of its calibrations."""

from __future__ import annotations

import pytest
from dsl_app.calibrate.overall import Overall


class Clock:
    """A clock that is set."""

    now = 0.0

    def __call__(self) -> float:
        return self.now


def test_the_time_left_follows_from_the_parts_that_are_done() -> None:
    clock = Clock()
    overall = Overall({"a": 2, "b": 4}, clock)
    assert overall.left_s() is None
    early = [overall.is_early]
    overall.begins("a", 1)
    early.append(overall.is_early)
    assert overall.left_s() is None
    overall.next_part()
    overall.report(1, 2)
    assert [*early, overall.is_early] == [False, True, False]
    clock.now = 10.0
    assert overall.share == pytest.approx(0.5 / 6)
    assert overall.left_s() == pytest.approx(110.0)
    overall.next_part()
    assert overall.share == pytest.approx(1 / 6)
    overall.ends()
    assert overall.share == pytest.approx(2 / 6)
    assert overall.name == ""
    clock.now = 30.0
    assert overall.left_s() == pytest.approx(60.0)


def test_what_was_done_before_counts_no_more() -> None:
    overall = Overall({"a": 9, "b": 9, "c": 2}, Clock())
    overall.begins("c", 0)
    overall.next_part()
    overall.report(1, 2)
    assert overall.share == pytest.approx(0.5)
    overall.ends()
    assert overall.share == 1.0


def test_a_part_never_goes_back() -> None:
    overall = Overall({"a": 1}, Clock())
    overall.begins("a", 0)
    overall.next_part()
    overall.report(3, 4)
    overall.report(1, 4)
    overall.report(0, 0)
    overall.next_part()
    assert overall.share == 0.0
    overall.report(5, 4)
    assert overall.share == 1.0
    # The end of the last part is not counted: "0 s left" would be said for as long as it takes.
    assert overall.left_s() is None
