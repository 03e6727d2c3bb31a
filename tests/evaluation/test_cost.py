"""The stage timer sees time and memory."""

from __future__ import annotations

import mmap
import threading
import time

import numpy as np
import pytest

from dsl_core.evaluation.cost import COSTS_ATTRIBUTE, StageCost, StageTimer, costs_of


def test_stages_are_kept_in_order_with_time_and_memory() -> None:
    timer = StageTimer()
    with timer.stage("small"):
        time.sleep(0.03)
    with timer.stage("large"):
        # Pages of its own: an array may get those that earlier tests have freed.
        block = mmap.mmap(-1, 160_000_000)
        np.frombuffer(block, np.uint8)[:] = 1
        time.sleep(0.5)  # a busy machine lets the watching thread wait
        block.close()
    assert [stage.name for stage in timer.stages] == ["small", "large"]
    small, large = timer.stages
    assert small.seconds >= 0.03
    # The memory is freed before the stage ends, so only a reading while it ran can have seen it.
    assert large.peak_bytes - large.start_bytes > 150e6


def test_a_failing_stage_is_kept_and_its_thread_ends() -> None:
    timer = StageTimer()
    with pytest.raises(RuntimeError, match="broken"), timer.stage("fails"):
        raise RuntimeError("broken")
    assert timer.stages[0].name == "fails"
    assert all(thread.name != "memory watch" for thread in threading.enumerate())


@pytest.mark.parametrize("text", ["5", "[", "{}", "[1]", '[{"name": "a"}]', "[" * 5000, 5.0])
def test_costs_that_nobody_can_read_are_none(text: object) -> None:
    assert costs_of({COSTS_ATTRIBUTE: text}) == []
    assert costs_of({}) == []
    told = '[{"name": "a", "seconds": 1.5, "peak_bytes": 7, "start_bytes": 5}]'
    assert costs_of({COSTS_ATTRIBUTE: told}) == [StageCost("a", 1.5, 7, 5)]
