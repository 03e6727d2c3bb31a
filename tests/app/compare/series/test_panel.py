"""The series tab: its table, plot and pictures by mouse and keys."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from dsl_app.compare.series.panel import SeriesPanel
from dsl_app.compare.series.state import NOTHING, SeriesKind
from dsl_app.shared.theme import DARK
from dsl_app.shared.widgets.open_dialog import OpenDialog
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QFileDialog, QLineEdit
from pytestqt.qtbot import QtBot

from tests.app.support.compare_page import POSITIONS, Bench
from tests.app.support.compare_page import bench as bench
from tests.app.support.compare_page import stage as stage
from tests.app.support.doubles import RecordingNotifier
from tests.cases.stage_series import write_stage, write_sweep


def filled(qtbot: QtBot, bench: Bench, stage: list[Path]) -> SeriesPanel:
    panel = bench.see()
    bench.drop(*stage)
    qtbot.waitUntil(lambda: len(bench.state.counted) == len(stage), timeout=30_000)
    return panel


def test_an_empty_series_says_what_to_do(qtbot: QtBot, bench: Bench) -> None:
    panel = bench.see()
    assert panel.hint.text() == NOTHING[SeriesKind.STAGE]
    qtbot.waitUntil(panel.hint.isVisible)
    assert not panel.parts.isVisible()
    assert not panel.report.isEnabled()
    panel.kind.setCurrentIndex(1)
    panel.kind.activated.emit(1)
    assert panel.hint.text() == NOTHING[SeriesKind.SWEEP]
    assert bench.page.command_line() == ""


def test_results_dropped_together_become_a_depth_test(qtbot: QtBot, bench: Bench, stage: list[Path]) -> None:
    panel = filled(qtbot, bench, stage)
    assert not panel.hint.isVisible()
    assert [panel.table.item(i, 1).text() for i in range(4)] == ["700", "725", "750", "775"]  # type: ignore[union-attr]
    assert panel.figures.item(0, 0).text() == "Straightness, slope free (RMS)"  # type: ignore[union-attr]
    assert " ± " in panel.figures.item(2, 1).text()  # type: ignore[union-attr]
    assert "worst" in panel.plot.content.legend.text()
    assert panel.plot.content.legend.textFormat() is Qt.TextFormat.RichText, "its signs are coloured"
    (low, high), _ = panel.plot.content.plot.getViewBox().viewRange()
    assert low < POSITIONS[0] < POSITIONS[-1] < high
    shown = panel.picture.content.image.image
    assert shown.shape == (36, 48)
    assert np.isfinite(shown).any()
    assert panel.picture.content.title.text() == "stage 700 mm: off its plane (mm)"
    panel.table.selectRow(2)
    assert panel.picture.content.title.text() == "stage 750 mm: off its plane (mm)"
    assert bench.page.command_line().startswith("dsl-scan depth-test ")
    bench.page.apply_theme(DARK)


def test_a_position_is_typed_and_a_row_removed_by_keys(qtbot: QtBot, bench: Bench, stage: list[Path]) -> None:
    panel = filled(qtbot, bench, stage)
    editor = editor_of_second(panel)
    editor.setText("730,5")
    QTest.keyClick(editor, Qt.Key.Key_Return)
    qtbot.waitUntil(lambda: bench.state.rows.value[1].position_mm == 730.5)
    panel.table.setFocus()
    panel.table.selectRow(1)
    QTest.mouseClick(panel.remove, Qt.MouseButton.LeftButton)
    assert [row.position_mm for row in bench.state.rows.value] == [700.0, 750.0, 775.0]
    bench.undo.undo()
    bench.undo.undo()
    assert [row.position_mm for row in bench.state.rows.value] == list(POSITIONS)
    first = panel.table.item(0, 1)
    assert first is not None
    first.setText("far")
    qtbot.waitUntil(lambda: panel.table.item(0, 1).text() == "700")  # type: ignore[union-attr]


def editor_of_second(panel: SeriesPanel) -> QLineEdit:
    """The editor of the second row's position, opened."""
    item = panel.table.item(1, 1)
    assert item is not None
    panel.table.setCurrentItem(item)
    panel.table.editItem(item)
    (editor,) = panel.table.findChildren(QLineEdit)
    assert isinstance(editor, QLineEdit)
    return editor


def test_a_position_is_typed_while_other_results_are_read(
    qtbot: QtBot, bench: Bench, stage: list[Path], tmp_path: Path
) -> None:
    panel = filled(qtbot, bench, stage)
    editor = editor_of_second(panel)
    editor.setText("73")
    bench.drop(write_stage(tmp_path, 800.0))
    qtbot.waitUntil(lambda: len(bench.state.counted) == len(stage) + 1, timeout=30_000)
    assert panel.table.findChildren(QLineEdit) == [editor]
    QTest.keyClicks(editor, "0,5")
    QTest.keyClick(editor, Qt.Key.Key_Return)
    qtbot.waitUntil(lambda: bench.state.rows.value[1].position_mm == 730.5)
    qtbot.waitUntil(lambda: panel.table.rowCount() == len(stage) + 1)


def test_an_editor_left_by_escape_shows_what_came_meanwhile(
    qtbot: QtBot, bench: Bench, stage: list[Path], tmp_path: Path
) -> None:
    panel = filled(qtbot, bench, stage)
    editor = editor_of_second(panel)
    bench.page._series_control.remove(stage[0])
    assert panel.table.rowCount() == len(stage)
    QTest.keyClick(editor, Qt.Key.Key_Escape)
    qtbot.waitUntil(lambda: panel.table.rowCount() == len(stage) - 1)


@pytest.mark.slow
def test_the_rectangle_on_the_picture_is_all_that_counts(
    qtbot: QtBot, bench: Bench, stage: list[Path]
) -> None:
    panel = filled(qtbot, bench, stage)
    QTest.mouseClick(panel.picture.content.part, Qt.MouseButton.LeftButton)
    assert bench.state.region.value == (14, 11, 20, 14)
    qtbot.waitUntil(lambda: len(bench.state.counted) == len(stage), timeout=30_000)
    target = bench.state.rows.value[0].target
    assert target is not None
    assert target.plane.pixels <= 20 * 14
    panel.picture.content.rectangle.setSize((24, 20))
    panel.picture.content.rectangle.sigRegionChangeFinished.emit(panel.picture.content.rectangle)
    assert bench.state.region.value == (14, 11, 24, 20)
    QTest.mouseClick(panel.picture.content.part, Qt.MouseButton.LeftButton)
    assert not panel.picture.content.part.isChecked()
    qtbot.waitUntil(lambda: not bench.state.busy.value, timeout=30_000)


def test_a_series_that_changes_below_the_file_dialog_is_not_reported(
    qtbot: QtBot, bench: Bench, stage: list[Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    panel = filled(qtbot, bench, stage)

    def ask(*_: object) -> tuple[str, str]:
        bench.page._series_control.set_position(stage[1], 730.0)
        return str(tmp_path / "series.html"), ""

    monkeypatch.setattr(QFileDialog, "getSaveFileName", ask)
    QTest.mouseClick(panel.report, Qt.MouseButton.LeftButton)
    notifier = bench.page._series_control._notifier
    assert isinstance(notifier, RecordingNotifier)
    assert "have changed while you chose a file" in notifier.told[-1][1]
    assert not (tmp_path / "series.html").exists()


@pytest.mark.slow
def test_accuracy_over_time_and_its_report(
    qtbot: QtBot, bench: Bench, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    panel = bench.see()
    paths = write_sweep(tmp_path)
    panel.kind.setCurrentIndex(1)
    panel.kind.activated.emit(1)
    monkeypatch.setattr(OpenDialog, "ask", lambda *_, **__: tmp_path)
    QTest.mouseClick(panel.add, Qt.MouseButton.LeftButton)
    qtbot.waitUntil(lambda: not bench.state.busy.value and bool(bench.state.rows.value), timeout=30_000)
    at = panel.against.findText("reference")
    panel.against.setCurrentIndex(at)
    panel.against.activated.emit(at)
    qtbot.waitUntil(lambda: len(bench.state.points) == len(paths) - 1, timeout=30_000)
    remarks = {
        panel.table.item(i, 0).text(): panel.table.item(i, 5).text()  # type: ignore[union-attr]
        for i in range(panel.table.rowCount())
    }
    assert remarks["good"] == "No faster scan is better"
    assert remarks["slow"] == ""
    assert remarks["reference"] == "This is the reference."
    assert not panel.figures.isVisible()
    bench.page._series_control.remove(paths[0])
    assert panel.against.currentText() == "reference"
    panel.figure.setCurrentIndex(1)
    panel.figure.activated.emit(1)
    assert "Reflectance" in panel.plot.content.plot.getPlotItem().getAxis("left").labelText
    monkeypatch.setattr(QFileDialog, "getSaveFileName", lambda *_: (str(tmp_path / "s"), ""))
    QTest.mouseClick(panel.report, Qt.MouseButton.LeftButton)
    qtbot.waitUntil(lambda: (tmp_path / "s.html").exists(), timeout=30_000)
