from __future__ import annotations

import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from dsl_app.compare.page import ComparePage
from dsl_app.compare.pair.controller import PairController
from dsl_app.compare.pair.state import PairState
from dsl_app.compare.series.controller import SeriesController
from dsl_app.compare.series.state import SeriesKind, SeriesState
from dsl_app.composition.window import Composition, StartOptions
from dsl_app.results.controller import ResultsController
from dsl_app.results.state import QualityMap, ResultsState, ResultView
from dsl_app.session.parts import (
    compare_part,
    restore_comparison,
    restore_result,
    restore_scan,
    restore_series,
    results_part,
    scan_part,
    series_part,
)
from dsl_app.session.records import ResultsPart, ScanPart, SeriesPart, Session
from dsl_app.session.store import SessionStore, is_running
from dsl_app.shared.undo import UndoStack
from PySide6.QtWidgets import QApplication, QPushButton
from pytestqt.qtbot import QtBot

from dsl_core.errors import DeviceError
from dsl_core.evaluation.time_sweep import FIGURES
from dsl_core.model.frames import Frame
from dsl_core.simulation.sim_devices import SimCamera
from tests.app.support.doubles import InlineRunner, RecordingNotifier
from tests.app.support.scan_bench import make_bench
from tests.app.support.small_result import write_small_result
from tests.cases.stage_series import write_stage, write_sweep

#: A number that no process has.
NOBODY = 2**30
LEAF = Session(page="results", results=ResultsPart(path=Path("leaf.zarr")))


@pytest.fixture
def gone() -> int:
    """The number of a process that ended."""
    ended = subprocess.Popen([sys.executable, "-c", ""])
    ended.wait()
    return ended.pid


def test_a_session_is_written_only_after_a_change(tmp_path: Path) -> None:
    sessions = iter([Session(), Session(page="scan"), LEAF, LEAF, Session(page="scan")])
    store = SessionStore(tmp_path / "sessions", lambda: next(sessions), process=7)
    for _ in range(2):
        assert store.save() == ""
    # Nothing is open yet.
    assert not (tmp_path / "sessions").exists()
    assert store.save() == ""
    (file,) = (tmp_path / "sessions").iterdir()
    assert Session.model_validate_json(file.read_bytes()) == LEAF
    file.write_text("not written again")
    store.save()
    assert file.read_text() == "not written again"
    store.save()
    assert Session.model_validate_json(file.read_bytes()) == Session(page="scan")
    store.remove()
    assert not file.exists()


def test_what_a_crash_left_is_found_once(tmp_path: Path, gone: int) -> None:
    crashed = SessionStore(tmp_path, lambda: LEAF, process=gone)
    crashed.save()
    store = SessionStore(tmp_path, Session)
    assert store.crashed_session() == (LEAF, "")
    assert store.crashed_session() == (None, "")


def test_what_a_running_program_has_open_is_left_to_it(tmp_path: Path) -> None:
    other = SessionStore(tmp_path, lambda: LEAF, process=os.getpid())
    other.save()
    assert is_running(os.getpid())
    assert SessionStore(tmp_path, Session, process=NOBODY).crashed_session() == (None, "")


def test_a_damaged_session_is_put_aside_with_a_sentence(tmp_path: Path) -> None:
    (tmp_path / f"session-{NOBODY}.json").write_text('{"results": {"path": ')
    found, trouble = SessionStore(tmp_path, Session).crashed_session()
    assert found is None
    assert "could not be read" in trouble
    assert (tmp_path / f"session-{NOBODY}.damaged.json").exists()
    assert SessionStore(tmp_path, Session).crashed_session() == (None, "")


def test_a_folder_that_cannot_be_written_is_told_once(tmp_path: Path) -> None:
    (tmp_path / "sessions").write_text("a file in the way")
    sessions = iter([LEAF, Session(page="scan")])
    store = SessionStore(tmp_path / "sessions", lambda: next(sessions), process=7)
    assert "cannot be saved" in store.save()
    assert store.save() == ""


def test_a_result_is_looked_at_as_before(tmp_path: Path) -> None:
    path = write_small_result(tmp_path)

    def opened() -> ResultsController:
        return ResultsController(ResultsState(), InlineRunner(), RecordingNotifier(), UndoStack())

    first = opened()
    assert results_part(first.state) is None
    first.open(path)
    first.step_band(-5)
    first.point_at((7, 8))
    first.marks.pin((7, 8))
    first.show(ResultView.QUALITY)
    first.state.quality.set(QualityMap.SHARE)
    first.limit_depth((705.0, 710.0))
    first.relight("A", adapted=False)
    part = results_part(first.state)
    assert part is not None
    again = opened()
    restore_result(part, again)
    assert results_part(again.state) == part
    assert [mark.pixel for mark in again.state.marks.value] == [(7, 8)]


def test_a_plan_comes_back(tmp_path: Path) -> None:
    first = make_bench(tmp_path)
    assert scan_part(first.state) is None
    first.plan()
    first.scans.plans.set_target(tmp_path / "leaf.dsl")
    first.scans.plans.set_override(True)
    part = scan_part(first.state)
    assert part is not None
    again = make_bench(tmp_path)
    restore_scan(part, again.scans)
    assert again.state.plan.value == first.state.plan.value
    assert again.state.target.value == tmp_path / "leaf.dsl"
    assert not again.state.then_reconstruct.value
    # Nobody overrides a check unasked.
    assert not again.state.override.value


def test_a_scan_that_the_crash_interrupted_can_be_gone_on_with(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    first = make_bench(tmp_path)
    first.rig.connect(first.rig.state.choice.value)
    first.plan()
    parts: list[ScanPart | None] = []

    def crash(camera: SimCamera, timeout_ms: float = 5000.0) -> Frame:
        parts.append(scan_part(first.state))
        raise DeviceError("The power failed.")

    monkeypatch.setattr(SimCamera, "snap", crash)
    first.scans.start()
    assert parts[0] is not None
    again = make_bench(tmp_path)
    restore_scan(parts[0], again.scans)
    session = again.state.interrupted.value
    assert session is not None
    assert session.folder == tmp_path / "first.dsl"


def test_a_comparison_comes_back(tmp_path: Path) -> None:
    (tmp_path / "b").mkdir()
    a, b = write_small_result(tmp_path), write_small_result(tmp_path / "b")

    def compared() -> PairController:
        return PairController(PairState(), InlineRunner(), RecordingNotifier())

    first = compared()
    assert compare_part(first.state) is None
    first.open(a)
    first.open(b)
    part = compare_part(first.state)
    assert part is not None
    again = compared()
    restore_comparison(part, again)
    assert again.state.pair.value is not None
    assert compare_part(again.state) == part


def several() -> SeriesController:
    return SeriesController(SeriesState(), InlineRunner(), RecordingNotifier(), UndoStack())


def test_a_depth_test_comes_back_with_its_positions_and_region(tmp_path: Path) -> None:
    stage = [write_stage(tmp_path, position) for position in (700.0, 725.0, 750.0)]
    first = several()
    assert series_part(first.state) is None
    first.add(stage)
    first.set_position(stage[1], 726.0)
    first.set_region((10, 6, 24, 20))
    part = series_part(first.state)
    assert part is not None
    assert Session(series=part).names == ("a series of 3 results",)
    assert Session(series=SeriesPart(rows=part.rows[:1])).names == ("a series of 1 result",)
    again = several()
    restore_series(SeriesPart.model_validate_json(part.model_dump_json()), again)
    assert series_part(again.state) == part
    assert again.state.test.value == first.state.test.value is not None


def test_a_sweep_comes_back_without_what_is_gone(tmp_path: Path) -> None:
    reference, *scans = write_sweep(tmp_path)
    first = several()
    first.ask(SeriesKind.SWEEP)
    first.add([reference, *scans])
    first.compare_with(reference)
    first.show_figure(FIGURES[1])
    part = series_part(first.state)
    assert part is not None
    shutil.rmtree(scans[0])
    again = several()
    restore_series(part, again)
    assert [row.path for row in again.state.rows.value] == [reference, *scans[1:]]
    assert (again.state.against.value, again.state.figure.value) == (reference, FIGURES[1])
    assert scans[0].name in again._notifier.told[-1][1]  # type: ignore[attr-defined]


class Bench:
    """A program that runs in a folder."""

    def __init__(self, qtbot: QtBot, folder: Path) -> None:
        self.composition = Composition(StartOptions())
        self.window = self.composition.open_window(folder)
        qtbot.addWidget(self.window)
        self.window.show()
        self.session = self.composition.session

    def button(self, text: str) -> QPushButton:
        found = [
            button
            for toast in self.window.toasts.shown
            for button in toast.findChildren(QPushButton)
            if button.text() == text
        ]
        (one,) = found
        return one


def wait_until(holds: Callable[[], bool]) -> None:
    for _ in range(1000):
        if holds():
            return
        QApplication.processEvents()
        time.sleep(0.02)
    pytest.fail("It never came true.")


def test_after_a_crash_the_window_offers_once_what_was_open(
    qtbot: QtBot, tmp_path: Path, gone: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = write_small_result(tmp_path)
    with monkeypatch.context() as crashing:
        crashing.setattr(os, "getpid", lambda: gone)
        crashed = Bench(qtbot, tmp_path)
    crashed.session.start()
    crashed.window.open_path(path)
    wait_until(lambda: not crashed.window.parts.runner.active)
    crashed.window.do("view_depth")
    crashed.session.save()
    again = Bench(qtbot, tmp_path)
    again.session.start()
    again.button("Restore session").click()
    wait_until(lambda: not again.window.parts.runner.active)
    assert again.session.collect() == crashed.session.collect()
    again.session.save()
    again.window.close()
    later = Bench(qtbot, tmp_path)
    later.session.start()
    assert later.window.toasts.shown == ()
    later.window.close()
    crashed.window.close()


def test_a_series_comes_back_where_it_is_seen(qtbot: QtBot, tmp_path: Path) -> None:
    stage = [write_stage(tmp_path, position) for position in (700.0, 725.0, 750.0)]
    part = SeriesPart(rows=tuple((path, None) for path in stage))
    bench = Bench(qtbot, tmp_path)
    bench.session.restore(Session(page="compare", series=part))
    wait_until(lambda: not bench.window.parts.runner.active)
    page = bench.window.page_of("compare")
    assert isinstance(page, ComparePage)
    assert page._shows_series
    found = bench.session.collect().series
    assert found is not None
    assert [path for path, _ in found.rows] == stage
    bench.window.close()


def test_a_result_that_is_gone_is_told(qtbot: QtBot, tmp_path: Path) -> None:
    bench = Bench(qtbot, tmp_path)
    bench.session.restore(LEAF)
    assert "leaf.zarr does not exist any more" in bench.window.toasts.shown[-1].text
    bench.window.close()
