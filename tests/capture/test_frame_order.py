"""Numbers of frames wrap and skip, cameras restart, clocks jump: only old pictures are refused."""

from __future__ import annotations

import logging

import numpy as np
import pytest

from dsl_core.capture.frame_order import FrameOrder, StaleFrameError
from dsl_core.model.frames import Frame


def _frame(number: int, time_s: float) -> Frame:
    return Frame(np.zeros((2, 2), np.uint16), 1.0, time_s, number)


@pytest.mark.parametrize("second", [(5, 1.0), (5, 2.0), (6, 1.0), (4, 0.5)])
def test_an_old_frame_is_refused(second: tuple[int, float]) -> None:
    order = FrameOrder()
    order.take(_frame(5, 1.0))
    with pytest.raises(StaleFrameError, match=f"frame number {second[0]} again"):
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
