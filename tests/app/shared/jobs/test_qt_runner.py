from __future__ import annotations

import threading

import pytest
from dsl_app.shared.jobs.base import Job, JobState
from dsl_app.shared.jobs.qt_runner import QtRunner
from PySide6.QtCore import QThread
from pytestqt.qtbot import QtBot

from dsl_core.errors import DecodeError, DeviceError
from dsl_core.progress import Progress
from tests.app.support.doubles import InlineRunner


def test_a_job_reports_and_ends_with_its_result() -> None:
    results: list[int] = []

    def work(progress: Progress) -> int:
        progress.report("adding", 3, 4)
        return 7

    job = InlineRunner().submit(Job("Sum", work, on_done=results.append))
    assert results == [7]
    assert job.state is JobState.DONE
    assert (job.progress.stage, job.progress.done, job.progress.total) == ("adding", 3, 4)


def test_a_failure_is_handed_over_and_not_raised() -> None:
    told: list[Exception] = []

    def work(progress: Progress) -> None:
        raise DecodeError("no light")

    job = InlineRunner().submit(Job("Decode", work, on_failed=told.append))
    assert job.state is JobState.FAILED
    assert [str(error) for error in told] == ["no light"]


def test_a_cancelled_job_stops_at_its_next_report() -> None:
    steps: list[int] = []
    ended: list[str] = []

    def work(progress: Progress) -> None:
        for i in range(5):
            progress.report("steps", i, 5)
            steps.append(i)
            if i == 1:
                job.cancel()

    job = Job("Steps", work, on_cancelled=lambda: ended.append("cancelled"))
    InlineRunner().submit(job)
    assert steps == [0, 1]
    assert ended == ["cancelled"]
    assert job.state is JobState.CANCELLED


def test_callbacks_run_in_the_thread_of_the_window(qtbot: QtBot) -> None:
    runner = QtRunner()
    seen: list[object] = []

    def work(progress: Progress) -> int:
        seen.append(threading.current_thread() is threading.main_thread())
        return 1

    with qtbot.waitSignal(runner.changed, check_params_cb=None):
        runner.submit(Job("Work", work, on_done=lambda _: seen.append(QThread.isMainThread())))
    qtbot.waitUntil(lambda: len(seen) == 2)
    assert seen == [False, True]
    assert runner.active == ()
    runner.shut_down()


@pytest.mark.parametrize("is_handled", [False, True])
def test_an_error_that_a_job_does_not_handle_is_told_once(qtbot: QtBot, is_handled: bool) -> None:
    runner = QtRunner()
    told: list[str] = []
    handled: list[str] = []
    runner.failed.connect(told.append)

    def work(progress: Progress) -> None:
        raise DecodeError("no light")

    handle = (lambda error: handled.append(str(error))) if is_handled else None
    runner.submit(Job("Decode", work, on_failed=handle))
    qtbot.waitUntil(lambda: runner.active == ())
    assert (handled, told) == ((["no light"], []) if is_handled else ([], ["no light"]))
    runner.shut_down()


def test_two_jobs_cannot_use_one_rig(qtbot: QtBot) -> None:
    runner, gate = QtRunner(), threading.Event()
    runner.submit(Job("First scan", lambda progress: gate.wait(5), exclusive="the rig"))
    with pytest.raises(DeviceError, match="Second scan needs the rig, which First scan is using"):
        runner.submit(Job("Second scan", lambda progress: None, exclusive="the rig"))
    gate.set()
    qtbot.waitUntil(lambda: runner.active == ())
    runner.shut_down()


def test_shutting_down_stops_what_runs(qtbot: QtBot) -> None:
    runner, started = QtRunner(), threading.Event()

    def work(progress: Progress) -> None:
        while True:
            progress.report("for ever", 0, 0)
            started.set()

    runner.submit(Job("Endless", work))
    assert started.wait(5)
    runner.shut_down()


def test_what_the_end_of_a_job_begins_after_shutting_down_is_left(qtbot: QtBot) -> None:
    runner, done = QtRunner(), threading.Event()
    late: list[Job[None]] = []
    runner.submit(
        Job("First", lambda progress: done.set(), lambda _: late.append(runner.submit(Job("Late", fail))))
    )
    assert done.wait(5)
    runner.shut_down()
    qtbot.waitUntil(lambda: bool(late))
    assert runner.active == ()
    assert late[0].state is JobState.CANCELLED


def fail(progress: Progress) -> None:
    pytest.fail("a job began after the end")
