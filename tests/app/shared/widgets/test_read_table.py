"""Tables that are only read: the column whose lines are wrapped keeps room for a few words."""

from __future__ import annotations

import pytest
from dsl_app.shared.widgets.read_table import LEAST_WRAPPED_PX, ReadTable, cell
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
