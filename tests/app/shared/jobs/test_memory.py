from __future__ import annotations

import gc
import threading
import weakref
from collections.abc import Iterator

import pytest
from dsl_app.shared.jobs.memory import FULL_S, GarbageCollector


class Knot:
    """Holds itself, so that only the collector finds it."""

    def __init__(self) -> None:
        self.itself = self


class Day:
    """Whether jobs run, and what time it is."""

    def __init__(self) -> None:
        self.is_busy, self.time_s = False, 0.0
        self.keeper = GarbageCollector(lambda: self.is_busy, lambda: self.time_s)


@pytest.fixture
def day() -> Iterator[Day]:
    made = Day()
    gc.collect()
    made.keeper.start()
    yield made
    made.keeper.stop()
    assert gc.isenabled()


def allocate() -> list[list[int]]:
    """Make more objects than Python lets pass without a look for garbage."""
    return [[i] for i in range(3 * gc.get_threshold()[0])]


def test_a_thread_takes_nothing_apart_that_belongs_to_the_window(day: Day) -> None:
    knot = weakref.ref(Knot())
    thread = threading.Thread(target=allocate)
    thread.start()
    thread.join()
    assert knot() is not None
    kept = allocate()
    day.keeper.check()
    assert kept
    assert knot() is None


def test_little_garbage_may_wait_until_a_job_ends(day: Day) -> None:
    day.is_busy = True
    knot = weakref.ref(Knot())
    day.keeper.check()
    assert knot() is not None
    day.is_busy = False
    day.keeper.check()
    assert knot() is None


@pytest.mark.slow
def test_what_grew_old_is_found_in_time_but_not_while_a_job_runs(day: Day) -> None:
    held = Knot()
    knot = weakref.ref(held)
    gc.collect()
    del held
    day.is_busy, day.time_s = True, 10 * FULL_S
    kept = allocate()
    day.keeper.check()
    assert kept
    assert knot() is not None
    day.is_busy = False
    day.keeper.check()
    assert knot() is None


def test_no_thread_collects_by_itself_while_windows_are_tested() -> None:
    assert not gc.isenabled()
