"""How long a reconstruction is expected to take."""

from __future__ import annotations

import pytest
from dsl_app.scan.reconstruction_time import START_S, USUAL_US_PER_PX, Pace


def test_the_pace_of_the_last_one_tells_the_next_and_is_kept() -> None:
    kept: list[float] = []
    pace = Pace(0.0, kept.append)
    assert pace.expected_s((1000, 1000)) == pytest.approx(START_S + USUAL_US_PER_PX)
    pace.learn((100, 100), START_S + 2.0)
    assert pace.expected_s((1000, 1000)) == pytest.approx(START_S + 200.0)
    assert kept == [pytest.approx(200.0)]
    assert Pace(kept[0]).expected_s((10, 10)) == pytest.approx(START_S + 0.02)


def test_what_was_disturbed_is_not_taken_for_the_pace() -> None:
    pace = Pace(100.0)
    for seconds in (1e-6, 1e6):
        pace.learn((100, 100), seconds)
    assert pace.expected_s((100, 100)) == pytest.approx(START_S + 1.0)


def test_a_small_picture_that_took_seconds_to_start_says_nothing_of_large_ones() -> None:
    pace = Pace(50.0)
    pace.learn((64, 48), 2.5)
    assert pace.expected_s((1000, 1000)) == pytest.approx(START_S + 50.0)
