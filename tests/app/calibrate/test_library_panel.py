"""The verdict of a drift check, and what it offers."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest
from dsl_app.calibrate.library_panel import DriftWindow, LibraryPanel
from dsl_app.calibrate.state import DriftVerdict
from PySide6.QtCore import QEvent
from PySide6.QtWidgets import (
    QApplication,
    QFileDialog,
    QLabel,
)

from dsl_core.io.calibration_library import LibraryLine
from dsl_core.model.figure import Figure
from dsl_core.simulation.published_rig import published_rig
from tests.app.calibrate.page_stage import Stage, cell, click

LIMITED = Figure(name="error", value=0.8, std=0.1, unit="px", high=0.5, advice="Hold it still.")


@pytest.fixture(autouse=True)
def panel(stage: Stage) -> LibraryPanel:
    """The list, which the page makes only once it is seen."""
    return stage.page.library


def test_a_drift_check_shows_its_figures(stage: Stage) -> None:
    stage.bench.state.drift.set(DriftVerdict("room 12", (LIMITED,)))
    window = stage.page.findChild(DriftWindow)
    assert isinstance(window, DriftWindow)
    assert cell(window.table, 0, 2) == "0.80 ± 0.10 px"
    assert cell(window.table, 0, 4) == "Hold it still."
    window.close()


def test_an_export_has_the_ending_by_which_it_is_imported(
    panel: LibraryPanel, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    asked: list[tuple[object, ...]] = []
    monkeypatch.setattr(LibraryPanel, "line", SimpleNamespace(name="room 12"))
    monkeypatch.setattr(LibraryPanel, "key", "room 12")
    monkeypatch.setattr(panel._commands, "export", lambda *given, **how: asked.append((*given, how)))
    folder = "Published layout, a folder (*)"
    for kind, form, name in (("", "entry", "room.v2.json"), (folder, "published", "room.v2")):
        chosen = (str(tmp_path / "room.v2"), kind)
        monkeypatch.setattr(QFileDialog, "getSaveFileName", lambda *_, chosen=chosen: chosen)
        panel._export()
        assert asked.pop() == ("room 12", tmp_path / name, form, {"overwrite": form == "published"})
    proposed = (str(tmp_path / "room.v2.json"), folder)
    monkeypatch.setattr(QFileDialog, "getSaveFileName", lambda *_: proposed)
    panel._export()
    assert asked.pop() == ("room 12", tmp_path / "room.v2", "published", {"overwrite": False})


def test_the_version_that_is_selected_stays_so_when_others_come_and_go(
    stage: Stage, panel: LibraryPanel
) -> None:
    library = stage.bench.state.library
    old, now = LibraryLine("room 12", "20260301", False), LibraryLine("room 12", "20260302", True)
    library.set((now, old))
    panel.table.selectRow(1)
    assert panel.key == "room 12@20260301"
    library.set((LibraryLine("bench", "20260303", True), now, old))
    assert panel.key == "room 12@20260301"
    library.set((replace(old, is_current=True), replace(now, is_current=False)))
    assert panel.key == "room 12"
    assert panel.line is not None
    assert panel.line.stamp == old.stamp
    library.set((now,))
    assert panel.key == "room 12", "another one is selected when it is gone"
    library.set(())
    assert panel.key == ""


def test_a_missed_drift_check_offers_to_check_again_and_to_go_on(
    stage: Stage, monkeypatch: pytest.MonkeyPatch
) -> None:
    checks: list[tuple[object, ...]] = []
    library = type(stage.bench.control.library)
    monkeypatch.setattr(library, "check", lambda self, *asked: checks.append(asked))
    verdict = DriftVerdict("room 12", (LIMITED,), spectralon=False, overridden=("the gain was 6 and is 0",))

    def shown() -> DriftWindow:
        stage.bench.state.drift.set(replace(verdict))
        window = stage.page.findChild(DriftWindow)
        assert isinstance(window, DriftWindow)
        assert any("the gain was 6" in each.text() for each in window.findChildren(QLabel))
        return window

    window = shown()
    assert window.again.property("role") == "primary"
    click(window.again)
    assert checks == [("room 12", False, True)]
    QApplication.sendPostedEvents(None, QEvent.Type.DeferredDelete)
    stage.bench.library.store("room 12", published_rig())
    click(shown().use)
    stage.wait(lambda: stage.bench.state.in_use.value == "room 12")


def test_a_passed_drift_check_has_nothing_to_offer(stage: Stage) -> None:
    stage.bench.state.drift.set(DriftVerdict("room 12", (LIMITED.model_copy(update={"high": 2.0}),)))
    window = stage.page.findChild(DriftWindow)
    assert isinstance(window, DriftWindow)
    assert not window.again.isVisible()
    assert not window.use.isVisible()
    window.close()
