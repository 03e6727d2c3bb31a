"""The time left of a job: whole, smooth, and honest about what it does not know."""

from __future__ import annotations

from itertools import pairwise

import pytest
from dsl_app.shared.jobs.clock import Course, JobClock, TimeLeft


class Time:
    """A clock that is told what time it is."""

    def __init__(self) -> None:
        self.s = 0.0

    def __call__(self) -> float:
        return self.s


def _work(clock: JobClock, time: Time, stage: str, seconds: int, reports: int = 10) -> list[TimeLeft]:
    """A stage of even reports; the times left that were shown."""
    shown = []
    for done in range(reports + 1):
        clock.report(stage, done, reports)
        left = clock.left()
        if left is not None:
            shown.append(left)
        if done < reports:
            time.s += seconds / reports
    return shown


def test_a_first_job_knows_its_stage_and_a_second_one_the_whole() -> None:
    time, courses = Time(), dict[str, Course]()
    first = JobClock("Reconstruct", courses, time)
    shown = _work(first, time, "decode", 10)
    assert not any(each.is_whole for each in shown)
    _work(first, time, "spectra", 40)
    first.end()
    assert courses["Reconstruct"] == pytest.approx({"decode": 10, "spectra": 40})
    second = JobClock("Reconstruct", courses, time)
    shown = _work(second, time, "decode", 20)
    assert all(each.is_whole for each in shown)
    # Twice as slow as the last one, so 80 s of spectra follow.
    assert shown[-1].seconds == pytest.approx(80, rel=0.02)


def test_what_is_shown_falls_and_does_not_jump() -> None:
    time = Time()
    clock = JobClock("Export", {}, time)
    shown = [each.seconds for each in _work(clock, time, "write", 100, 100)]
    assert all(later <= sooner for sooner, later in pairwise(shown))
    # A burst that takes a tenth of the time moves it only a little at once.
    clock = JobClock("Export", {}, time)
    _work(clock, time, "write", 10)
    clock.report("more", 1, 10)
    time.s += 1.0
    before = clock.left()
    clock.report("more", 9, 10)
    time.s += 0.1
    after = clock.left()
    assert before is not None
    assert after is not None
    assert before.seconds == pytest.approx(9.0)
    assert after.seconds == pytest.approx(before.seconds - 0.1, abs=0.3)


def test_without_a_total_nothing_is_claimed() -> None:
    clock = JobClock("Open", {}, Time())
    clock.report("read", 3, 0)
    assert clock.left() is None
