"""The table of colours of the marks."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from dsl_app.results.answers.colours_panel import EMPTY, THIN, ColoursPanel, _value
from dsl_app.shared.theme import LIGHT
from dsl_app.shared.widgets.read_table import LEAST_WIDE_PX, RIGHT, cell
from PySide6.QtGui import QGuiApplication
from pytestqt.qtbot import QtBot

from dsl_core.io.result.result_file import load_result, save_result
from dsl_core.optics.colour import reflectance_to_lab
from tests.app.support.results_controller import SQUARE, Bench
from tests.app.support.results_controller import bench as bench
from tests.app.support.small_result import BLUE, RED, write_reference, write_small_result


def test_marks_have_colours_and_differences_to_the_selected_one(qtbot: QtBot, bench: Bench) -> None:
    panel = ColoursPanel(bench.state)
    qtbot.addWidget(panel)
    panel.show()
    assert panel.text.text() == EMPTY
    bench.control.marks.pin((30, 5))
    bench.control.marks.add_outline(SQUARE)
    panel.apply_theme(LIGHT)
    assert [panel.table.item(row, 0).text() for row in range(2)] == ["pin 1", "region 1"]  # type: ignore[union-attr]
    result = bench.state.result.value
    assert result is not None
    light, _, _ = reflectance_to_lab(result["reflectance"][:, 5, 30].astype(float), result.wavelengths_nm)
    shown = panel.table.item(0, 1)
    assert shown is not None
    assert float(shown.text().split("±")[0]) == pytest.approx(light, abs=0.05)
    # The region was added last and is selected, so it has no difference to itself.
    assert [panel.table.item(row, 4).text() == "" for row in range(2)] == [False, True]  # type: ignore[union-attr]
    panel.copy.click()
    lines = QGuiApplication.clipboard().text().splitlines()
    assert lines[0].startswith("place\tlight\tL*")
    assert len(lines) == 1 + 2 * panel.light.count()


def test_a_mark_that_lacks_a_band_has_a_colour_and_one_of_a_few_bands_has_none(
    qtbot: QtBot, tmp_path: Path
) -> None:
    result = load_result(write_small_result(tmp_path)).load()
    result["reflectance"][3] = np.nan
    result["reflectance"][:20, 5, 3] = np.nan
    result["reflectance"][12:35, 5, 25] = np.nan
    bench = Bench(save_result(result, tmp_path / "lacking.zarr"))
    panel = ColoursPanel(bench.state)
    qtbot.addWidget(panel)
    panel.show()
    for pixel in ((30, 5), (3, 5), (25, 5)):
        bench.control.marks.pin(pixel)
    assert [panel.table.item(row, 0).text() for row in range(panel.table.rowCount())] == ["pin 1"]  # type: ignore[union-attr]


def test_a_reference_that_states_no_deviation_has_none(qtbot: QtBot, bench: Bench, tmp_path: Path) -> None:
    panel = ColoursPanel(bench.state)
    qtbot.addWidget(panel)
    panel.show()
    bench.control.marks.pin((30, 5))
    bench.control.marks.add_reference(write_reference(tmp_path / "tile.csv", BLUE))
    texts = [[panel.table.item(row, column).text() for column in (1, 4)] for row in range(2)]  # type: ignore[union-attr]
    assert ["±" in text for text in texts[0]] == [True, True]
    assert "±" not in texts[1][0]
    assert float(texts[1][0]) > 0
    panel.copy.click()
    cells = QGuiApplication.clipboard().text().splitlines()[2].split("\t")
    assert cells[0] == "tile"
    assert [cell == "" for cell in cells[2:8]] == [False, True] * 3


def test_a_difference_of_references_without_deviations_has_none(
    qtbot: QtBot, bench: Bench, tmp_path: Path
) -> None:
    panel = ColoursPanel(bench.state)
    qtbot.addWidget(panel)
    panel.show()
    for name, curve in (("tile.csv", BLUE), ("other.csv", RED)):
        bench.control.marks.add_reference(write_reference(tmp_path / name, curve))
    bench.state.selected.set(bench.state.marks.value[0].key)
    panel.apply_theme(LIGHT)
    shown = panel.table.item(1, 4)
    assert shown is not None
    assert float(shown.text()) > 1
    panel.copy.click()
    other = QGuiApplication.clipboard().text().splitlines()[2].split("\t")
    assert float(other[8]) > 1
    assert other[9] == ""


def test_names_are_read_in_a_narrow_table(qtbot: QtBot, bench: Bench) -> None:
    panel = ColoursPanel(bench.state)
    qtbot.addWidget(panel)
    panel.resize(260, 300)
    panel.show()
    for place in range(20):
        bench.control.marks.pin((30 - place % 2, 5))
    assert panel.table.columnWidth(0) >= LEAST_WIDE_PX
    # What the page has for it in a window of 1280 px.
    panel.resize(436, 300)
    assert not panel.table.horizontalScrollBar().isVisible()
    panel.resize(900, 300)
    assert panel.table.columnWidth(0) > 2 * LEAST_WIDE_PX


def test_figures_of_many_marks_are_whole_in_a_window_of_1280_px(qtbot: QtBot, bench: Bench) -> None:
    panel = ColoursPanel(bench.state)
    qtbot.addWidget(panel)
    panel.resize(436, 300)
    panel.show()
    figures = ((41.0, 0.42), (-44.05, 0.85), (-44.05, 12.85), (20.37, 10.2))
    texts = [_value(*figure) for figure in figures]
    assert [text.replace(THIN, "") for text in texts] == ["41.00±0.42", "−44.05±0.85", "−44±13", "20±10"]
    assert _value(41.0, 0.003).replace(THIN, "") == "41.00±0.01", "not zero"
    panel.table.show()
    panel.table.show_rows([(cell("pin 1"), *(cell(text, "", RIGHT) for text in texts)) for _ in range(40)])
    wide = sum(panel.table.columnWidth(column) for column in range(5))
    assert wide <= panel.table.viewport().width()


def test_marks_of_one_name_have_a_row_each(qtbot: QtBot, bench: Bench) -> None:
    panel = ColoursPanel(bench.state)
    qtbot.addWidget(panel)
    panel.show()
    for pixel in ((30, 5), (3, 3)):
        bench.control.marks.pin(pixel)
        bench.control.marks.rename(bench.state.marks.value[-1].key, "leaf")
    bench.state.selected.set(bench.state.marks.value[0].key)
    panel.apply_theme(LIGHT)
    cells = [[panel.table.item(row, column).text() for column in (0, 1, 4)] for row in range(2)]  # type: ignore[union-attr]
    assert [row[0] for row in cells] == ["leaf", "leaf (2)"]
    assert cells[0][1] != cells[1][1]
    assert [row[2] == "" for row in cells] == [True, False]
