"""Frame numbers rise through wraps, restarts and counters that begin at 0."""

from __future__ import annotations

import pytest

from dsl_core.devices.drivers.frame_counter import FrameCounter


@pytest.mark.parametrize(
    ("ids", "numbers"),
    [
        ([0, 1, 2], [0, 1, 2]),
        ([65534, 65535, 1, 2], [65534, 65535, 65536, 65537]),
        # A counter that includes 0 in its turn, and one that lost the frames about its wrap.
        ([65534, 65535, 0, 1], [65534, 65535, 65536, 65537]),
        ([65530, 3], [65530, 65538]),
        # The camera started to count again.
        ([700, 701, 1, 2], [700, 701, 702, 703]),
        # The same frame twice must be seen as such.
        ([5, 5, 6], [5, 5, 6]),
    ],
)
def test_numbers_rise_by_what_the_ids_rise(ids: list[int], numbers: list[int]) -> None:
    counter = FrameCounter()
    assert [counter.number(each) for each in ids] == numbers


def test_after_many_wraps_every_number_is_new() -> None:
    counter = FrameCounter(last=15)
    numbers = [counter.number(i % 15 + 1) for i in range(100)]
    assert numbers == list(range(1, 101))


def test_a_camera_opened_again_continues_after_the_last() -> None:
    counter = FrameCounter()
    first = [counter.number(each) for each in (65401, 65402)]
    counter.restart()
    second = [counter.number(each) for each in (65401, 65402)]
    assert first + second == [65401, 65402, 65403, 65404]
