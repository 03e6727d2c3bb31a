from __future__ import annotations

import gc
import sys
import threading
import weakref
from collections.abc import Iterator

import psutil
import pytest

from app.jobs import housekeeping


class Knot:
    """Holds itself, so that only the collector finds it."""

    def __init__(self) -> None:
        self.itself = self


@pytest.fixture
def taken_over() -> Iterator[None]:
    housekeeping.take_over_collection()
    yield
    housekeeping.give_back_collection()
    assert gc.isenabled()


def allocate() -> None:
    """Make more objects than Python lets pass without a look for garbage."""
    kept = [[i] for i in range(3 * gc.get_threshold()[0])]
    assert kept


@pytest.mark.usefixtures("taken_over")
def test_a_thread_takes_nothing_apart_that_belongs_to_the_window() -> None:
    knot = weakref.ref(Knot())
    thread = threading.Thread(target=allocate)
    thread.start()
    thread.join()
    assert knot() is not None
    allocate()
    kept = [[i] for i in range(2 * gc.get_threshold()[0])]
    housekeeping.collect()
    assert kept
    assert knot() is None


@pytest.mark.usefixtures("taken_over")
def test_little_garbage_may_wait() -> None:
    gc.collect()
    knot = weakref.ref(Knot())
    housekeeping.collect()
    assert knot() is not None


@pytest.mark.skipif(sys.platform != "linux", reason="other systems have other heaps")
def test_freed_memory_goes_back_to_the_system() -> None:
    process = psutil.Process()
    blocks = [bytearray(20_000) for _ in range(5_000)]
    last = bytearray(20_000)
    full = process.memory_info().rss
    del blocks
    housekeeping.return_memory()
    assert len(last) == 20_000
    assert full - process.memory_info().rss > 60e6
