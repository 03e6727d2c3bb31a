"""A question before something ends: the safe answer is that of Enter and Escape."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from dsl_app.shared.widgets.dialogs import confirm
from PySide6.QtCore import Qt, QTimer
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QMessageBox, QPushButton, QWidget
from pytestqt.qtbot import QtBot


def _press(key: Qt.Key) -> Callable[[QMessageBox], None]:
    return lambda box: QTest.keyClick(box, key)


def _click(text: str) -> Callable[[QMessageBox], None]:
    def do(box: QMessageBox) -> None:
        (button,) = (each for each in box.findChildren(QPushButton) if each.text() == text)
        QTest.mouseClick(button, Qt.MouseButton.LeftButton)

    return do


@pytest.mark.parametrize(
    ("answer", "goes"),
    [
        (_press(Qt.Key.Key_Return), False),
        (_press(Qt.Key.Key_Escape), False),
        (_click("Keep working"), False),
        (_click("Stop and quit"), True),
    ],
)
def test_only_the_button_that_names_it_ends_something(
    qtbot: QtBot, answer: Callable[[QMessageBox], None], goes: bool
) -> None:
    parent = QWidget()
    qtbot.addWidget(parent)
    parent.show()

    def look() -> None:
        asked = QApplication.activeModalWidget()
        if isinstance(asked, QMessageBox):
            answer(asked)
        else:
            QTimer.singleShot(5, look)

    QTimer.singleShot(0, look)
    assert confirm(parent, "Jobs", "A <b>scan</b> runs.", "Stop and quit", "Keep working") is goes
