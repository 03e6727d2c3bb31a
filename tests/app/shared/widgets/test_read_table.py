"""Tables that are only read: the column whose lines are wrapped keeps room for a few words."""

from __future__ import annotations

import pytest
from dsl_app.shared.theme import DARK, LIGHT
from dsl_app.shared.widgets.read_table import LEAST_WRAPPED_PX, RIGHT, ReadTable, cell
from PySide6.QtCore import Qt
from PySide6.QtGui import QColor
from pytestqt.qtbot import QtBot


@pytest.mark.parametrize(("width_px", "scrolls"), [(700, False), (200, True)])
def test_a_narrow_table_scrolls_instead_of_wrapping_single_words(
    qtbot: QtBot, width_px: int, scrolls: bool
) -> None:
    table = ReadTable("effects", "", ("Effect", "At most", "Why"))
    table.wrap(2)
    qtbot.addWidget(table)
    table.show_rows([[cell("second-orders"), cell("4095 DN"), cell("Their columns reach the frame. " * 3)]])
    table.resize(700, 300)
    table.show()
    table.resize(width_px, 300)
    header, bar = table.horizontalHeader(), table.horizontalScrollBar()
    qtbot.waitUntil(lambda: (bar.maximum() > 0) is scrolls)
    assert header.sectionSize(2) >= LEAST_WRAPPED_PX
    if not scrolls:
        assert header.length() == table.viewport().width()


@pytest.mark.parametrize("width_px", [900, 300])
def test_values_stay_next_to_names_that_are_wrapped_where_there_is_less_room(
    qtbot: QtBot, width_px: int
) -> None:
    table = ReadTable("figures", "", ("Figure", "Value"))
    table.wrap(0, fills=False)
    qtbot.addWidget(table)
    table.show_rows([[cell("Straightness with the slope fixed to one"), cell("0.0197 ± 0.0004", side=RIGHT)]])
    table.resize(width_px, 200)
    table.show()
    header = table.horizontalHeader()
    needed_px = table.sizeHintForColumn(0)
    qtbot.waitUntil(lambda: header.sectionSize(0) == needed_px if width_px == 900 else header.length() < 300)
    assert table.horizontalScrollBar().maximum() == 0
    assert (table.rowHeight(0) > 2 * table.fontMetrics().height()) is (width_px == 300)


def test_a_table_without_rows_says_what_will_be_there(qtbot: QtBot) -> None:
    table = ReadTable("Figures", "What was found", ("Name", "Verdict"))
    qtbot.addWidget(table)
    table.resize(300, 120)
    table.show()

    def colours() -> set[int]:
        image = table.viewport().grab().toImage()
        return {image.pixel(x, y) for x in range(image.width()) for y in range(40, image.height())}

    assert len(colours()) == 1
    table.empty_text = "What a check finds is listed here."
    said = colours()
    assert QColor(DARK.muted).rgb() in said
    table.show_rows([[cell("depth"), cell("good")]])
    assert QColor(DARK.muted).rgb() not in colours()


def test_cells_with_a_role_follow_the_theme_and_tell_nobody(qtbot: QtBot) -> None:
    table = ReadTable("Figures", "What was found", ("Name", "Verdict"))
    qtbot.addWidget(table)
    told: list[object] = []
    table.itemChanged.connect(told.append)
    table.show_rows([[cell("depth"), cell("missed", "bad")], [cell("angle", "muted"), cell("good", "good")]])

    def colours() -> list[str]:
        items = [table.item(row, column) for row, column in ((0, 1), (1, 0), (1, 1))]
        return [item.foreground().color().name() for item in items if item is not None]

    assert colours() == [DARK.bad, DARK.muted, DARK.good]
    table.apply_theme(LIGHT)
    assert colours() == [LIGHT.bad, LIGHT.muted, LIGHT.good]
    table.show_rows([[cell("depth"), cell("missed", "warn")]])
    plain, late = table.item(0, 0), table.item(0, 1)
    assert plain is not None
    assert late is not None
    assert late.foreground().color().name() == LIGHT.warn
    assert plain.data(Qt.ItemDataRole.ForegroundRole) is None, "the usual colour, selected or not"
    assert told == []


def test_heads_stand_over_their_figures_and_one_column_fills_the_width(qtbot: QtBot) -> None:
    table = ReadTable("Areas", "", ("Name", "Pixels"))
    qtbot.addWidget(table)
    table.widen(0)
    table.resize(400, 100)
    table.show_rows([(cell("chart"), cell("12", "", RIGHT))])
    table.show()
    side = Qt.ItemDataRole.TextAlignmentRole
    assert table.model().headerData(1, Qt.Orientation.Horizontal, side) == RIGHT
    assert table.columnWidth(0) + table.columnWidth(1) == table.viewport().width()
