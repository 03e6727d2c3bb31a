"""Tasks in processes: each once, again where a process died, and no more at once than memory allows."""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Sequence
from pathlib import Path

import pytest

from dsl_core.solve import limits
from dsl_core.workflows.batch.processes import Processes
from dsl_core.workflows.batch.runner import MOST_DEATHS, Ended, Rows
from dsl_core.workflows.batch.task import Outcome, ScanTask
from tests.cases import batch_work as work


def tasks_in(folder: Path, names: str) -> dict[int, ScanTask]:
    return {i: ScanTask(folder / f"{n}.dsl", folder / f"{n}.zarr") for i, n in enumerate(names)}


def outcomes(runner: Processes, tasks: dict[int, ScanTask]) -> Sequence[Outcome]:
    ended = {e.task: e.outcome for e in runner.run(tasks) if isinstance(e, Ended)}
    return [ended[i] for i in tasks]


@pytest.mark.slow
def test_every_task_is_done_once_and_tells_of_its_rows(tmp_path: Path) -> None:
    tasks = tasks_in(tmp_path, "abc")
    events = list(Processes(2, work=work.quick).run(tasks))
    assert sorted(e.task for e in events if isinstance(e, Ended)) == [0, 1, 2]
    assert {e for e in events if isinstance(e, Rows)} == {Rows(i, 1) for i in range(3)}
    assert [work.begun(task) for task in tasks.values()] == [1, 1, 1]


@pytest.mark.slow
def test_only_the_task_whose_process_died_is_done_again(tmp_path: Path) -> None:
    tasks = tasks_in(tmp_path, "abc")
    assert [o.state for o in outcomes(Processes(1, work=work.dies_once), tasks)] == ["made"] * 3
    assert [work.begun(task) for task in tasks.values()] == [1, 2, 1]


@pytest.mark.slow
def test_a_task_that_kills_its_process_is_given_up_and_the_others_are_done(tmp_path: Path) -> None:
    tasks = tasks_in(tmp_path, "abc")
    found = outcomes(Processes(1, work=work.dies), tasks)
    assert [o.state for o in found] == ["made", "failed", "made"]
    assert work.begun(tasks[1]) == MOST_DEATHS
    assert "died 3 times, the last time with exit code 9" in found[1].sentence


@pytest.mark.slow
@pytest.mark.parametrize(("memory", "most"), [(2.5, 2), (0.5, 1)])
def test_tasks_wait_for_memory_but_one_always_runs(tmp_path: Path, memory: float, most: int) -> None:
    runner = Processes(3, memory, lambda task: 1.0, work.meets_others)
    found = outcomes(runner, tasks_in(tmp_path, "abcde"))
    assert max(o.seconds for o in found) <= most


def test_kernels_share_the_cores(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("OMP_NUM_THREADS")
    # Those that this process may use.
    monkeypatch.setattr(limits, "_OWN", tmp_path / "none")
    monkeypatch.setattr(os, "sched_getaffinity", lambda process: set(range(8)), raising=False)
    found = outcomes(Processes(2, work=work.meets_others), tasks_in(tmp_path, "a"))
    assert found[0].sentence == "4"


def test_a_batch_that_is_stopped_leaves_no_process(tmp_path: Path) -> None:
    before = set(multiprocessing.active_children())
    events = Processes(2, work=work.sleeps).run({**tasks_in(tmp_path, "ab")})
    quick = Processes(1, work=work.quick).run(tasks_in(tmp_path, "c"))
    next(quick)
    assert set(multiprocessing.active_children()) != before
    quick.close()
    events.close()
    assert set(multiprocessing.active_children()) == before
