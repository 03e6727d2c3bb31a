"""Tasks in processes of this computer: as many as there are jobs, fewer where memory does not suffice."""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Generator, Mapping
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from typing import Any

from dsl_core.solve.heap import keep_freed_memory
from dsl_core.solve.limits import usable_cores
from dsl_core.solve.threads import share_cores
from dsl_core.workflows.batch.runner import MOST_DEATHS, Ended, Rows, given_up
from dsl_core.workflows.batch.task import ScanTask, SeenRows, do_task

#: Makes the outcome of a task; a test may use another one.
Work = Callable[[ScanTask, SeenRows | None], Any]


@dataclass
class _Worker:
    process: Any
    channel: Connection
    task: int | None = None


class Processes:
    """A `Runner` of up to so many processes, each of which does one task after the other.

    ``needs_bytes`` says what memory a task takes; tasks wait while those that run leave too little of
    ``memory_bytes``, but one always runs.
    """

    def __init__(
        self,
        jobs: int,
        memory_bytes: float = float("inf"),
        needs_bytes: Callable[[ScanTask], float] = lambda task: 0.0,
        work: Work = do_task,
    ) -> None:
        self._jobs, self._memory_bytes, self._needs_bytes, self._work = jobs, memory_bytes, needs_bytes, work
        self._threads = max(usable_cores() // jobs, 1)

    def run(self, tasks: Mapping[int, ScanTask]) -> Generator[Rows | Ended, None, None]:
        """Do tasks; one whose process dies is done again, by another process, a few times."""
        waiting, needs = list(tasks), {number: self._needs_bytes(task) for number, task in tasks.items()}
        deaths: dict[int, int] = {}
        workers: list[_Worker] = []
        try:
            while waiting or any(worker.task is not None for worker in workers):
                self._hand_out(tasks, waiting, needs, workers)
                busy = {worker.channel: worker for worker in workers if worker.task is not None}
                for channel in wait(list(busy)):
                    worker = busy[channel]  # type: ignore[index]
                    number = worker.task
                    assert number is not None
                    try:
                        told = worker.channel.recv()
                    except (EOFError, OSError):
                        workers.remove(worker)
                        how = _end(worker)
                        deaths[number] = deaths.get(number, 0) + 1
                        if deaths[number] < MOST_DEATHS:
                            waiting.insert(0, number)
                        else:
                            yield Ended(number, given_up(tasks[number], how))
                        continue
                    if isinstance(told, tuple):
                        yield Rows(number, *told)
                    else:
                        worker.task = None
                        yield Ended(number, told)
        finally:
            for worker in workers:
                _end(worker)

    def _hand_out(
        self,
        tasks: Mapping[int, ScanTask],
        waiting: list[int],
        needs: Mapping[int, float],
        workers: list[_Worker],
    ) -> None:
        while waiting:
            running = [worker.task for worker in workers if worker.task is not None]
            taken = sum(needs[number] for number in running)
            if len(running) == self._jobs or (running and taken + needs[waiting[0]] > self._memory_bytes):
                return
            worker = next((each for each in workers if each.task is None), None)
            if worker is None:
                worker = self._started()
                workers.append(worker)
            worker.task = waiting.pop(0)
            with contextlib.suppress(OSError):  # a process that died is noticed when it is listened to
                worker.channel.send(tasks[worker.task])

    def _started(self) -> _Worker:
        # Spawned on every system: a fork would copy threads of torch and locks in any state.
        context = multiprocessing.get_context("spawn")
        ours, theirs = context.Pipe()
        process = context.Process(target=_serve, args=(theirs, self._threads, self._work), daemon=True)
        process.start()
        theirs.close()
        return _Worker(process, ours)


def _end(worker: _Worker) -> str:
    """End a process, or what is left of it; says how it ended before."""
    worker.channel.close()
    worker.process.join(timeout=0.2)
    code = worker.process.exitcode
    if code is None:
        worker.process.kill()
        worker.process.join()
        return "it was stopped"
    return f"the last time by signal {-code}" if code < 0 else f"the last time with exit code {code}"


def _serve(channel: Connection, threads: int, work: Work) -> None:
    """Do what comes through a channel until it is closed."""
    # Ctrl-C reaches the whole group; the process that handed out the tasks ends this one.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    share_cores(threads)
    keep_freed_memory()
    threading.Thread(target=_end_with_parent, daemon=True, name="parent watch").start()
    while True:
        try:
            task = channel.recv()
        except (EOFError, OSError):
            return
        channel.send(work(task, lambda done, total: channel.send((done,))))


def _end_with_parent() -> None:
    """End this process at once when the one that started it is killed: the next batch continues its work."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        wait([parent.sentinel])
        os._exit(1)
