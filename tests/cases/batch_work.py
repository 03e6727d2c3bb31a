"""What a batch can be given to do in place of a reconstruction, in a process that finds it by its name."""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path

from dsl_core.workflows.batch.task import Outcome, ScanTask, SeenRows

#: The most that a test waits for another process, seconds.
PATIENCE_S = 60.0


def log_of(task: ScanTask) -> Path:
    """A file with a line for each time that a task was begun."""
    return task.target.with_suffix(".log")


def begun(task: ScanTask) -> int:
    """How many times a task was begun."""
    return len(log_of(task).read_text().split()) if log_of(task).exists() else 0


def _begin(task: ScanTask) -> None:
    with log_of(task).open("a") as log:
        log.write(f"{os.getpid()}\n")


def quick(task: ScanTask, seen_rows: SeenRows | None) -> Outcome:
    """Tells of one row and is done."""
    _begin(task)
    if seen_rows is not None:
        seen_rows(1, 2)
    return Outcome(task.scan, task.target, "made")


def dies_once(task: ScanTask, seen_rows: SeenRows | None) -> Outcome:
    """The scan called ``b`` kills its process the first time."""
    _begin(task)
    if task.scan.stem == "b" and begun(task) == 1:
        os.kill(os.getpid(), signal.SIGTERM)
        time.sleep(PATIENCE_S)
    return Outcome(task.scan, task.target, "made")


def dies(task: ScanTask, seen_rows: SeenRows | None) -> Outcome:
    """The scan called ``b`` kills its process."""
    _begin(task)
    if task.scan.stem == "b":
        os._exit(9)
    return Outcome(task.scan, task.target, "made")


def meets_others(task: ScanTask, seen_rows: SeenRows | None) -> Outcome:
    """Says how many threads its kernels have, and how many tasks run at the moment."""
    running = task.target.with_suffix(".running")
    running.touch()
    time.sleep(0.3)
    count = len(list(running.parent.glob("*.running")))
    running.unlink()
    return Outcome(task.scan, task.target, "made", sentence=os.environ["OMP_NUM_THREADS"], seconds=count)


def sleeps(task: ScanTask, seen_rows: SeenRows | None) -> Outcome:
    """Is at work until somebody ends its process."""
    _begin(task)
    time.sleep(PATIENCE_S)
    return Outcome(task.scan, task.target, "made")
