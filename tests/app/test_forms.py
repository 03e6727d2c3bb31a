from __future__ import annotations

import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from pytestqt.qtbot import QtBot

from app.widgets.forms import ChoiceBox


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
