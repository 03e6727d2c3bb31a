from __future__ import annotations

import pytest
from dsl_app.shared.widgets.forms import ChoiceBox
from dsl_app.shared.widgets.read_table import RIGHT, ReadTable, cell
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QLineEdit, QWidget
from pytestqt.qtbot import QtBot


@pytest.mark.parametrize("keys", [[Qt.Key.Key_G], [Qt.Key.Key_Down] * 2], ids=["typed", "arrows"])
def test_an_entry_that_was_found_by_keys_is_told(qtbot: QtBot, keys: list[Qt.Key]) -> None:
    box = ChoiceBox("Colour")
    qtbot.addWidget(box)
    for name in ("red", "blue", "green"):
        box.addItem(name)
    told: list[int] = []
    box.activated.connect(told.append)
    box.show()
    for key in keys:
        QTest.keyClick(box, key)
    assert box.currentText() == "green"
    assert told[-1] == 2


def test_a_table_to_read_shows_whole_cells_and_is_left_by_tab(qtbot: QtBot) -> None:
    window = QWidget()
    qtbot.addWidget(window)
    table, after = ReadTable("Figures", "What was found", ("Name", "Value")), QLineEdit()
    for child in (table, after):
        child.setParent(window)
    table.setRowCount(1)
    table.setItem(0, 0, cell("depth"))
    table.setItem(0, 1, cell("700.125 mm", side=RIGHT))
    with qtbot.waitActive(window):
        window.show()
        window.activateWindow()
    table.setFocus()
    table.setCurrentCell(0, 0)
    QTest.keyClick(table, Qt.Key.Key_F2)
    assert not table.findChildren(QLineEdit)
    assert {index.column() for index in table.selectedIndexes()} == {0, 1}
    QTest.keyClick(table, Qt.Key.Key_Tab)
    assert after.hasFocus()
