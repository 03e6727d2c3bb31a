"""The list of marks, the comparison of the selected one, and libraries."""

from __future__ import annotations

from pathlib import Path
from unittest.mock import Mock

import numpy as np
import pytest
from dsl_app.results.layers import Layers
from dsl_app.results.marks.comparison import comparison_html
from dsl_app.results.marks.library_dialog import LibraryDialog
from dsl_app.results.state import Mark
from dsl_app.shared.spectrum import Spectrum
from dsl_app.shared.theme import DARK as DARK_THEME
from dsl_app.shared.theme import LIGHT
from PySide6.QtCore import QMimeData, QPoint, QPointF, Qt, QUrl
from PySide6.QtGui import QDropEvent
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QFileDialog, QTreeWidgetItem
from pytestqt.qtbot import QtBot

from tests.app.support.results_bench import Bench, select
from tests.app.support.results_bench import bench as bench
from tests.app.support.small_result import BLUE, write_reference
from tests.io.spectra.test_reference_file import write_library


def test_the_list_names_hides_and_selects(bench: Bench) -> None:
    bench.control.marks.pin((10, 10))
    bench.control.marks.pin((20, 10))
    tree = bench.page.marks.tree
    first = tree.topLevelItem(0)
    assert first is not None
    first.setText(0, "sky")
    assert bench.marks[0].name == "sky"
    again = tree.topLevelItem(0)
    assert again is not None
    again.setCheckState(0, Qt.CheckState.Unchecked)
    assert not bench.marks[0].shown
    assert bench.marks[0].key not in bench.page.spectra.content._curves
    now = tree.topLevelItem(0)
    assert now is not None
    tree.setCurrentItem(now)
    assert bench.state.selected.value == bench.marks[0].key


def test_several_rows_are_selected_hidden_and_removed(bench: Bench) -> None:
    for column in (10, 15, 20, 25):
        bench.control.marks.pin((column, 10))
    panel = bench.page.marks
    items = [item for place in range(4) if (item := panel.tree.topLevelItem(place)) is not None]
    view = panel.tree.viewport()
    for place, held in ((0, Qt.KeyboardModifier.NoModifier), (2, Qt.KeyboardModifier.ControlModifier)):
        row = panel.tree.visualItemRect(items[place])
        at = QPoint(row.left() + 90, row.center().y())
        QTest.mouseClick(view, Qt.MouseButton.LeftButton, held, at)
    assert panel.tree.selectedItems() == [items[0], items[2]]
    assert bench.state.selected.value == bench.marks[2].key
    items[0].setCheckState(0, Qt.CheckState.Unchecked)
    assert [mark.shown for mark in bench.marks] == [False, True, False, True]
    QTest.keyClick(panel.tree, Qt.Key.Key_Delete)
    assert [mark.name for mark in bench.marks] == ["pin 2", "pin 4"]
    bench.window.parts.undo.undo()
    assert panel.tree.topLevelItemCount() == 4
    QTest.keyClick(panel.tree, Qt.Key.Key_A, Qt.KeyboardModifier.ControlModifier)
    QTest.mouseClick(panel.remove, Qt.MouseButton.LeftButton)
    assert not list(bench.marks)
    assert not panel.remove.isEnabled()


def test_rows_of_marks_that_stay_as_they_are_stay_too(bench: Bench) -> None:
    marks = bench.control.marks
    for column in (10, 20, 30):
        marks.pin((column, 10))
    tree = bench.page.marks.tree

    def rows() -> list[QTreeWidgetItem | None]:
        return [tree.topLevelItem(place) for place in range(tree.topLevelItemCount())]

    def names() -> list[str]:
        return [row.text(0) for row in rows() if row is not None]

    before = rows()
    first, _, third = before
    marks.pin((15, 10))
    assert rows()[:3] == before
    marks.remove(bench.marks[1].key)
    assert rows()[:2] == [first, third]
    bench.window.parts.undo.undo()
    assert names() == ["pin 1", "pin 2", "pin 3", "pin 4"]
    assert rows()[2] == third
    marks.rename(bench.marks[2].key, "sky")
    assert rows()[2] == third
    assert names() == ["pin 1", "pin 2", "sky", "pin 4"]
    assert third is not None
    third.setText(0, "  ")
    assert names() == ["pin 1", "pin 2", "sky", "pin 4"]
    bench.state.marks.set(())
    assert rows() == []


def test_a_mark_that_lost_its_spectrum_says_why_and_is_drawn_nowhere(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    nothing = Spectrum(np.empty(0), np.empty(0))
    bench.control.marks.pin((10, 10))
    bench.state.marks.set(
        (
            *bench.marks,
            Mark("pin", "far", 1, nothing, pixel=(990, 5), trouble="Pixel 990, 5 has no spectrum here."),
            Mark("region", "leaf", 2, nothing, runs=((990, 0, 5),), trouble="No pixel."),
            Mark("reference", "tile", 3, nothing, file=Path("tile.csv"), trouble="tile.csv is gone."),
        )
    )
    tree = bench.page.marks.tree
    rows = [tree.topLevelItem(row) for row in range(4)]
    assert [row.text(1) for row in rows if row is not None] == ["10, 10", *["no spectrum"] * 3]
    assert [row.toolTip(0) for row in rows[2:] if row is not None] == ["No pixel.", "tile.csv is gone."]
    assert list(bench.page.spectra.content._curves) == [bench.marks[0].key]
    assert len(bench.page.image.content.pins.data) == 1
    panel, result, drawn = bench.page.cloud, bench.state.result.value, Mock()
    assert result is not None
    with monkeypatch.context() as patch:
        patch.setattr(panel, "isVisible", lambda: True)
        patch.setattr(panel, "_layers", Layers(result))
        patch.setattr(panel, "view", drawn)
        panel._show_pins()
    assert len(drawn.show_pins.call_args.args[0]) == 1
    assert "distance" not in comparison_html(select(bench, 0), DARK_THEME)
    assert "Pixel 990, 5" in comparison_html(select(bench, 1), DARK_THEME)
    bench.page.marks.remove_selected()
    assert [mark.name for mark in bench.marks] == ["pin 1", "leaf", "tile"]


def test_references_are_dropped_and_compared(bench: Bench, qtbot: QtBot, tmp_path: Path) -> None:
    bench.control.marks.pin((10, 10))
    data = QMimeData()
    data.setUrls([QUrl.fromLocalFile(str(write_reference(tmp_path / "tile <b>.csv", 2 * BLUE)))])
    drop = QDropEvent(
        QPointF(50, 50),
        Qt.DropAction.CopyAction,
        data,
        Qt.MouseButton.LeftButton,
        Qt.KeyboardModifier.NoModifier,
    )
    bench.window.dropEvent(drop)
    qtbot.waitUntil(lambda: len(bench.marks) == 2)
    bench.state.selected.set(bench.marks[0].key)
    text = comparison_html(bench.state, LIGHT)
    assert "tile &lt;b&gt;" in text
    assert "2.000" in text
    qtbot.waitUntil(lambda: "ΔE00" in bench.page.marks.figures.toPlainText())


def test_a_library_that_is_dropped_asks_which_spectrum(bench: Bench, qtbot: QtBot, tmp_path: Path) -> None:
    bench.control.marks.pin((10, 10))
    bench.window.open_path(write_library(tmp_path / "plants.sli"))
    (dialog,) = bench.page.findChildren(LibraryDialog)
    assert not dialog.add.isEnabled()
    assert "2 of 2 listed, 0 selected" in dialog.text.text()
    dialog.filter.setText("BRI")
    assert [dialog.list.item(i).isHidden() for i in (0, 1)] == [True, False]
    dialog.list.selectAll()
    dialog.add.click()
    assert [mark.name for mark in bench.marks] == ["pin 1", "Brick"]
    assert not dialog.isVisible()
    bench.state.selected.set(bench.marks[0].key)
    qtbot.waitUntil(lambda: "Brick" in bench.page.marks.figures.toPlainText())
    bench.window.open_path(tmp_path / "plants.hdr")
    again = bench.page.findChildren(LibraryDialog)[-1]
    again.reject()
    assert bench.state.library.value is None
    assert len(bench.marks) == 2


def test_spectra_go_to_the_clipboard_and_to_a_file(
    bench: Bench, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench.control.marks.pin((10, 10))
    bench.page.marks.tree.setFocus()
    QTest.keyClick(bench.page.marks.tree, Qt.Key.Key_C, Qt.KeyboardModifier.ControlModifier)
    assert QApplication.clipboard().text().startswith("wavelength_nm\tpin 1: reflectance (1)\t")
    names = iter([str(tmp_path / "a"), "", str(tmp_path / "a.csv")])
    monkeypatch.setattr(QFileDialog, "getSaveFileName", lambda *_: (next(names), ""))
    for _ in range(3):
        bench.window.do("export_spectra")
    assert "Wrote 1 spectrum" in bench.window.toasts.shown[-1].text
    assert [path.name for path in tmp_path.glob("a*")] == ["a.csv"]
