from __future__ import annotations

import os
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from dsl_app.compare.page import ComparePage
from dsl_app.composition.window import Composition, StartOptions
from dsl_app.scan.state import Phase
from dsl_app.session.records import ResultsPart, ScanPart, SeriesPart, Session
from dsl_app.session.store import SessionStore
from PySide6.QtWidgets import QApplication, QPushButton
from pytestqt.qtbot import QtBot

from dsl_core.model.plan import CapturePlan
from tests.app.support.small_result import write_small_result
from tests.cases.stage_series import write_stage

LEAF = Session(page="results", results=ResultsPart(path=Path("leaf.zarr")))


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
    crashed.session._writer.submit(int).result()
    again = Bench(qtbot, tmp_path)
    again.session.start()
    offered = again.session.is_offered
    assert (offered.value, again.button("Restore session").property("role")) == (True, "primary")
    # Two blue buttons would be one too many.
    again.window.open_page("rig")
    assert (offered.value, again.button("Restore session").property("role")) == (False, "")
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


@pytest.mark.parametrize("results", [None, LEAF.results])
def test_a_plan_is_offered_no_longer_once_a_scan_runs(
    qtbot: QtBot, tmp_path: Path, gone: int, results: ResultsPart | None
) -> None:
    plan = ScanPart(plan=CapturePlan(), target=tmp_path / "leaf.dsl")
    SessionStore(tmp_path / "sessions", lambda: Session(page="scan", scan=plan, results=results), gone).save()
    bench = Bench(qtbot, tmp_path)
    bench.session.start()
    bench.window.open_page("scan")
    assert bench.session.scans is not None
    assert len(bench.window.toasts.shown) == 1
    bench.session.scans.state.phase.set(Phase.RUNNING)
    assert len(bench.window.toasts.shown) == (0 if results is None else 1)
    bench.session.scans.state.phase.set(Phase.DONE)
    bench.window.close()


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
    assert "leaf.zarr no longer exists" in bench.window.toasts.shown[-1].text
    bench.window.close()
