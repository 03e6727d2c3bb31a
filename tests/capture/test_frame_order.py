"""Numbers of frames wrap and skip, cameras restart, clocks jump: only old pictures are refused."""

from __future__ import annotations

import logging

import numpy as np
import pytest

from dsl_core.capture.frame_order import FrameOrder, StaleFrameError
from dsl_core.model.frames import Frame


def _frame(number: int, time_s: float, dn: int = 0) -> Frame:
    return Frame(np.full((2, 2), dn, np.uint16), 1.0, time_s, number)


@pytest.mark.parametrize(
    ("second", "why"),
    [
        ((5, 1.0), "again"),
        ((5, 2.0), "again"),
        ((6, 1.0), r"with time \(1 s\) and pixels of number 5: it is the picture before"),
        ((4, 0.5), "after number 5"),
    ],
)
def test_an_old_frame_is_refused(second: tuple[int, float], why: str) -> None:
    order = FrameOrder()
    order.take(_frame(5, 1.0))
    with pytest.raises(StaleFrameError, match=f"frame number {second[0]} {why}"):
        order.take(_frame(*second))
    assert order.take(_frame(7, 3.0)).frame_id == 7


@pytest.mark.parametrize(("last", "first"), [(65535, 0), (65535, 1), (2**32 - 1, 0), (250, 3)])
def test_a_counter_may_wrap(last: int, first: int) -> None:
    order = FrameOrder()
    order.take(_frame(last, 1.0))
    assert order.take(_frame(first, 2.0)).frame_id == first


def test_a_camera_that_restarts_counts_on_from_there(caplog: pytest.LogCaptureFixture) -> None:
    order = FrameOrder()
    order.take(_frame(900, 90.0))
    with pytest.raises(StaleFrameError):
        order.take(_frame(1, 0.1))
    assert order.take(_frame(2, 0.2)).frame_id == 2
    assert "counts its frames from 2 again" in caplog.text


def test_pictures_of_one_second_are_new_where_the_clock_tells_no_finer_ones(
    caplog: pytest.LogCaptureFixture,
) -> None:
    order = FrameOrder()
    for number, time_s in ((254, 7.0), (255, 7.0), (0, 7.0), (1, 8.0), (2, 8.0)):
        assert order.take(_frame(number, time_s, dn=number)).frame_id == number
    assert caplog.messages == [
        "frames 254 and 255 have the same time: the camera's clock is coarse or stands still; use the times"
        " at which patterns were shown instead"
    ]


def test_a_gap_is_told_once_and_only_where_there_are_usually_none(caplog: pytest.LogCaptureFixture) -> None:
    free_running, steady = FrameOrder(), FrameOrder()
    for number in range(1, 60, 3):
        free_running.take(_frame(number, float(number)))
    assert caplog.text == ""
    for number in (*range(1, 12), *range(15, 30), *range(40, 44)):
        steady.take(_frame(number, float(number)))
    assert caplog.text.count("the camera lost 3 frames before number 15") == 1
    assert "before number 40" not in caplog.text


def test_a_gap_after_a_failed_exposure_is_none(caplog: pytest.LogCaptureFixture) -> None:
    order = FrameOrder()
    for number in range(1, 12):
        order.take(_frame(number, float(number)))
    order.interrupted()
    order.take(_frame(15, 15.0))
    assert caplog.text == ""


def test_a_clock_that_jumps_is_told_and_frames_are_believed(caplog: pytest.LogCaptureFixture) -> None:
    seconds = iter([0.0, 1.0, 2.0, 3.0])
    order = FrameOrder(lambda: next(seconds))
    for number, time_s in enumerate((10.0, 11.0, 4000.0, 4001.0), start=1):
        order.take(_frame(number, time_s))
    assert caplog.messages == [
        "the camera's clock jumped by 3.99e+03 s before frame 3; use the times at which patterns were shown"
        " instead"
    ]
    caplog.clear()
    backwards = FrameOrder()
    backwards.take(_frame(1, 50.0))
    assert backwards.take(_frame(2, 40.0)).timestamp_s == 40.0
    assert "jumped by -10 s" in caplog.text


def test_a_frame_without_a_time_has_none(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.WARNING)
    order = FrameOrder()
    assert order.take(_frame(1, float("nan"))).timestamp_s == 0.0
    assert order.take(_frame(2, float("nan"))).timestamp_s == 0.0
    assert len(caplog.messages) == 1


@pytest.mark.parametrize(
    ("last", "first", "is_new"),
    [(224, 31, True), (223, 31, False), (224, 32, False), (2**64 - 1, 0, True), (2**16 - 32, 31, True)],
)
def test_a_counter_wraps_within_32_of_its_end(last: int, first: int, is_new: bool) -> None:
    order = FrameOrder()
    order.take(_frame(last, 1.0))
    if is_new:
        assert order.take(_frame(first, 2.0)).frame_id == first
    else:
        with pytest.raises(StaleFrameError):
            order.take(_frame(first, 2.0))


def test_a_number_that_wraps_at_the_same_time_is_an_old_frame() -> None:
    order = FrameOrder()
    order.take(_frame(250, 1.0))
    with pytest.raises(StaleFrameError):
        order.take(_frame(3, 1.0))


@pytest.mark.parametrize(("numbers", "is_told"), [(8, False), (9, True)])
@pytest.mark.parametrize("before", ["nothing", "failure", "gap"])
def test_a_gap_is_worth_a_word_after_eight_frames_without_one(
    numbers: int, is_told: bool, before: str, caplog: pytest.LogCaptureFixture
) -> None:
    order, first = FrameOrder(), 1
    if before != "nothing":
        order.take(_frame(1, 0.5))
        order.take(_frame(2, 0.7))
        first = 3 if before == "failure" else 40
    if before == "failure":
        order.take(_frame(3, 0.8))
        order.interrupted()
        first, numbers = 4, numbers - 1
    for k in range(numbers):
        order.take(_frame(first + k, 1.0 + k))
    order.take(_frame(first + numbers + 1, 99.0))
    assert ("the camera lost 1 frame before" in caplog.text) == is_told


@pytest.mark.parametrize(
    ("passed_s", "step_s", "is_told"),
    [(0.0, 1.9, False), (0.0, 2.1, True), (10.0, 12.9, False), (10.0, 13.1, True), (10.0, 7.1, False),
     (10.0, 6.9, True)],
)  # fmt: skip
def test_clocks_may_differ_by_two_seconds_and_a_tenth(
    passed_s: float, step_s: float, is_told: bool, caplog: pytest.LogCaptureFixture
) -> None:
    seconds = iter([5.0, 5.0 + passed_s])
    order = FrameOrder(lambda: next(seconds))
    order.take(_frame(1, 1.0))
    order.take(_frame(2, 1.0 + step_s))
    assert bool(caplog.messages) == is_told
    if is_told:
        assert f"jumped by {step_s - passed_s:.3g} s before frame 2" in caplog.text


def test_a_clock_that_stands_at_zero_is_none(caplog: pytest.LogCaptureFixture) -> None:
    seconds = iter([0.0, 1.0, 2.0])
    order = FrameOrder(lambda: next(seconds))
    for number, time_s in enumerate((0.0, 500.0, 0.0), start=1):
        order.take(_frame(number, time_s))
    assert caplog.messages == []
    order = FrameOrder()
    for number, time_s in enumerate((1.0, 1.5, 90.0), start=1):
        order.take(_frame(number, time_s))
    assert caplog.messages == [], "without a clock of ours any time that rises will do"
