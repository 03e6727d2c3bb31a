"""The same work on many things, in a few threads, that ends soon after it is cancelled."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, ThreadPoolExecutor, wait
from typing import TypeVar

from dsl_core.errors import Cancelled
from dsl_core.progress import Progress

T = TypeVar("T")
#: Called by work where it may stop; raises `Cancelled` when it has to.
Check = Callable[[], None]
#: How often progress is reported, which may cancel, s.
ASK_S = 0.2


def never() -> None:
    """A check that lets work continue."""


def work_through(
    work: Callable[[T, Check], object], things: Sequence[T], threads: int, stage: str, progress: Progress
) -> None:
    """Do ``work`` on all things; its first error, or a cancel, stops it on the others.

    Raises that error, or `Cancelled`, which ``progress`` may raise.
    """
    stopped = threading.Event()

    def check() -> None:
        if stopped.is_set():
            raise Cancelled(f"Stopped during {stage!r}.")

    with ThreadPoolExecutor(threads) as pool:
        waiting = {pool.submit(work, thing, check) for thing in things}
        try:
            while waiting:
                done, waiting = wait(waiting, ASK_S, FIRST_COMPLETED)
                for future in done:
                    future.result()
                progress.report(stage, len(things) - len(waiting), len(things))
        except BaseException:
            stopped.set()
            for future in waiting:
                future.cancel()
            raise
