from __future__ import annotations

import threading
import time
from collections.abc import Iterator

import pytest
from dsl_app.shared.jobs.base import Job, JobProgress
from dsl_app.shared.jobs.clock import TimeLeft
from dsl_app.shared.jobs.qt_runner import QtRunner
from dsl_app.shell.job_strip import NO_BREAK, JobStrip, strip_view
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from pytestqt.qtbot import QtBot

from dsl_core.progress import Progress


class Bench:
    """A strip, and jobs that run until they are cancelled or let go."""

    def __init__(self, qtbot: QtBot) -> None:
        self.runner, self._gate = QtRunner(), threading.Event()
        self.strip = JobStrip(self.runner)
        qtbot.addWidget(self.strip)
        self.strip.show()

    def run(self, title: str, is_minor: bool = False) -> Job[None]:
        def work(progress: Progress) -> None:
            while not self._gate.wait(0.01):
                progress.report("wait", 0, 0)

        return self.runner.submit(Job(title, work, is_minor=is_minor))

    @property
    def text(self) -> str:
        return self.strip._text.text().replace(NO_BREAK, " ")

    def click(self) -> None:
        QTest.mouseClick(self.strip._cancel, Qt.MouseButton.LeftButton)

    def end(self) -> None:
        self._gate.set()
        self.runner.shut_down()


@pytest.fixture
def bench(qtbot: QtBot) -> Iterator[Bench]:
    made = Bench(qtbot)
    yield made
    made.end()


def test_a_time_is_not_torn_from_its_unit(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Job, "left", TimeLeft(190.0, True))
    bench.run("Calibrate everything: find the board")
    assert bench.text.endswith("3 min left")
    assert bench.strip._text.text().endswith(NO_BREAK.join(("3", "min", "left")))


def test_work_that_runs_by_itself_does_not_hide_what_was_asked_for(bench: Bench) -> None:
    prediction = bench.run("Predict", is_minor=True)
    assert bench.text.startswith("Predict")
    export = bench.run("Export leaf")
    assert bench.text.startswith("Export leaf")
    assert bench.text.endswith("and 1 more")
    bench.click()
    assert export.token.is_cancelled
    assert not prediction.token.is_cancelled


@pytest.mark.parametrize(("is_whole", "words"), [(True, "40 s left"), (False, "40 s left of this step")])
def test_the_time_left_says_of_what(is_whole: bool, words: str, monkeypatch: pytest.MonkeyPatch) -> None:
    job = Job("Reconstruct leaf", lambda progress: None)
    monkeypatch.setattr(Job, "left", TimeLeft(40.0, is_whole))
    view = strip_view([job])
    assert view is not None
    assert view.text.split(" · ")[-1] == words


@pytest.mark.parametrize(
    ("stage", "words"),
    [("", []), ("Pose 2", []), ("pose 2", []), ("scan", ["scan"]), ("Pose 2: scan", ["Pose 2: scan"])],
)
def test_a_stage_that_the_title_names_is_not_said_again(stage: str, words: list[str]) -> None:
    job = Job("Geometry: Capture Pose 2", lambda progress: None, progress=JobProgress(stage))
    view = strip_view([job])
    assert view is not None
    assert view.text.split(" · ") == [job.title, *words]


def test_a_job_that_its_dialog_tells_of_is_not_told_twice() -> None:
    told = Job("Geometry: Capture Pose 2", lambda progress: None, is_told_elsewhere=True)
    assert strip_view([told]) is None
    other = Job("Export leaf", lambda progress: None)
    view = strip_view([told, other])
    assert view is not None
    assert (view.job, view.text, view.asks_which) == (other, "Export leaf", False)


def test_a_job_that_knows_better_is_believed() -> None:
    job = Job("Scan leaf", lambda progress: None, time_left=lambda: 90.0)
    assert job.left == TimeLeft(90.0, True)


def test_the_bar_is_of_the_whole_job_where_reports_are_of_a_step(bench: Bench) -> None:
    def work(progress: Progress) -> None:
        while True:
            progress.report("Pose 4: scan", 40, 40)
            time.sleep(0.01)

    job = bench.runner.submit(Job("Calibrate everything", work, share=lambda: 0.125))
    bench.strip._show()
    bar = bench.strip._bar
    assert bar.value() / bar.maximum() == 0.125
    job.cancel()


def test_work_that_runs_by_itself_can_be_cancelled_where_it_is_alone(bench: Bench) -> None:
    prediction = bench.run("Predict", is_minor=True)
    bench.click()
    assert prediction.token.is_cancelled
    assert "stopping" in bench.text


def test_of_several_jobs_the_one_to_cancel_is_chosen(qtbot: QtBot, bench: Bench) -> None:
    bench.run("Predict", is_minor=True)
    first, second = bench.run("Reconstruct A & B"), bench.run("Export leaf")
    menu = bench.strip._cancel.menu()
    bench.strip._cancel.click()
    assert menu.isVisible()
    assert not first.token.is_cancelled
    assert [action.text() for action in menu.actions()] == ["Reconstruct A && B", "Export leaf"]
    menu.actions()[1].trigger()
    menu.hide()
    assert (first.token.is_cancelled, second.token.is_cancelled) == (False, True)
    qtbot.waitUntil(lambda: second not in bench.runner.active)
    # One is left, which needs no choice.
    qtbot.waitUntil(lambda: bench.strip._cancel.menu() is None)
    bench.click()
    assert first.token.is_cancelled


def test_the_strip_is_hidden_while_nothing_runs(qtbot: QtBot, bench: Bench) -> None:
    job = bench.run("Export leaf")
    assert bench.strip.isVisible()
    job.cancel()
    qtbot.waitUntil(lambda: not bench.strip.isVisible())


def test_the_oldest_job_that_a_person_waits_for_is_shown() -> None:
    assert strip_view([]) is None
    minor, first, second = (
        Job(title, lambda progress: None, is_minor=title == "Predict")
        for title in ("Predict", "Export", "Scan")
    )
    view = strip_view([minor, first, second])
    assert view is not None
    assert (view.job, view.text, view.asks_which) == (first, "Export · and 2 more", True)
    alone = strip_view([minor])
    assert alone is not None
    assert (alone.job, alone.text, alone.asks_which, alone.can_cancel) == (minor, "Predict", False, True)


def test_a_job_that_is_stopping_says_so_and_cannot_be_cancelled_twice() -> None:
    job = Job("Export", lambda progress: None, progress=JobProgress("write", 1, 4))
    view = strip_view([job])
    assert view is not None
    assert view.text == "Export · write"
    job.cancel()
    view = strip_view([job])
    assert view is not None
    assert (view.text, view.can_cancel) == ("Export · stopping", False)
