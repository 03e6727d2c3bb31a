"""Enter presses the button with the focus or the blue one, and never starts what a person only typed."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import pytest
from dsl_app.shared.widgets.forms import ChoiceBox, check_box, push_button
from dsl_app.shared.widgets.page import PageWidget
from dsl_app.shell.actions import PAGES
from dsl_app.shell.application import make_window, open_first_page
from dsl_app.shell.main_window import MainWindow
from PySide6.QtCore import QEvent, Qt
from PySide6.QtGui import QKeyEvent
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QLineEdit, QListWidget, QVBoxLayout, QWidget
from pytestqt.qtbot import QtBot


class Page(PageWidget):
    """A blue button, another one, and parts that have a use of their own for Enter or none."""

    def __init__(self) -> None:
        super().__init__()
        self.pressed: list[str] = []
        self.blue = push_button("Start", "Starts", partial(self._press, "Start"), "primary")
        self.other = push_button("Look", "Looks", partial(self._press, "Look"))
        self.box, self.text = check_box("With film", "Whether"), QLineEdit()
        self.list, self.choice = QListWidget(), ChoiceBox("Plan", choices=[("quick", 1)])
        column = QVBoxLayout(self)
        for part in (self.other, self.blue, self.box, self.text, self.list, self.choice):
            column.addWidget(part)

    def _press(self, text: str, *_: object) -> None:
        self.pressed.append(text)


@pytest.fixture
def window(qtbot: QtBot, tmp_path: Path) -> MainWindow:
    made = make_window({page.key: Page for page in PAGES}, tmp_path)
    open_first_page(made)
    qtbot.addWidget(made)
    made.show()
    return made


@pytest.fixture
def page(window: MainWindow) -> Page:
    made = window.open_page("scan")
    assert isinstance(made, Page)
    return made


def enter(page: Page, focus: QWidget, modifier: Qt.KeyboardModifier = Qt.KeyboardModifier.NoModifier) -> str:
    """What is pressed by Enter on a part."""
    page.pressed.clear()
    focus.setFocus()
    QTest.keyClick(focus, Qt.Key.Key_Return, modifier)
    return ", ".join(page.pressed)


def test_enter_presses_the_blue_button(window: MainWindow, page: Page) -> None:
    assert enter(page, window.rail._buttons["scan"]) == "Start"
    assert enter(page, page.box) == "Start"
    assert enter(page, page) == "Start"
    assert enter(page, page, Qt.KeyboardModifier.KeypadModifier) == "Start"


def test_enter_presses_the_button_with_the_focus(page: Page) -> None:
    assert enter(page, page.other) == "Look"
    assert enter(page, page.blue) == "Start"


def test_enter_that_ends_typing_or_choosing_starts_nothing(page: Page) -> None:
    assert [enter(page, part) for part in (page.text, page.list, page.choice)] == ["", "", ""]


def test_enter_presses_nothing_that_cannot_be_pressed(window: MainWindow, page: Page) -> None:
    page.blue.setEnabled(False)
    assert enter(page, page.box) == ""
    page.blue.setEnabled(True)
    assert enter(page, page.box, Qt.KeyboardModifier.ShiftModifier) == ""
    page.pressed.clear()
    held = QKeyEvent(
        QEvent.Type.KeyPress, Qt.Key.Key_Return, Qt.KeyboardModifier.NoModifier, "", autorep=True
    )
    QApplication.sendEvent(page.box, held)
    assert page.pressed == []
    # Which of two a person means is not known.
    page.other.setProperty("role", "primary")
    assert enter(page, page.box) == ""
