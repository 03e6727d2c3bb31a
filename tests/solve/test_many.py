from __future__ import annotations

import threading
from concurrent.futures import Future, wait

import pytest

from dsl_core.errors import Cancelled
from dsl_core.progress import CallbackProgress, CancelToken, NoProgress
from dsl_core.solve.many import Check, work_through


def test_everything_is_done_and_told() -> None:
    done, told = list[int](), list[tuple[int, int]]()
    progress = CallbackProgress(lambda stage, n, total: told.append((n, total)))
    work_through(lambda i, check: done.append(i), range(20), 3, "count", progress)
    assert sorted(done) == list(range(20))
    assert told[-1] == (20, 20)
    work_through(lambda i, check: done.append(i), (), 3, "count", progress)


def test_a_cancel_stops_work_in_its_midst_and_begins_no_other() -> None:
    begun, token, never = list[int](), CancelToken(), threading.Event()

    def work(i: int, check: Check) -> None:
        begun.append(i)
        token.cancel()
        while not never.wait(0.005):
            check()

    with pytest.raises(Cancelled, match="after 0 of 50 steps"):
        work_through(work, range(50), 2, "wait", CallbackProgress(lambda *_: None, token))
    assert len(begun) <= 2


def test_the_first_error_stops_the_others() -> None:
    begun, never = list[int](), threading.Event()

    def work(i: int, check: Check) -> None:
        begun.append(i)
        if i == 1:
            raise ValueError("a bad thing")
        while not never.wait(0.005):
            check()

    with pytest.raises(ValueError, match="a bad thing"):
        work_through(work, range(50), 2, "wait", NoProgress())
    assert len(begun) <= 4


def test_who_waits_is_asked_five_times_a_second(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = list[float | None]()

    def noted(futures: set[Future[object]], timeout: float | None, until: str) -> object:
        asked.append(timeout)
        return wait(futures, timeout, until)

    monkeypatch.setattr("dsl_core.solve.many.wait", noted)
    work_through(lambda i, check: None, (1,), 1, "once", NoProgress())
    assert set(asked) == {0.2}
