"""A question before something ends: the safe answer is that of Enter and Escape."""

from __future__ import annotations

from collections.abc import Callable

import pytest
import shiboken6
from dsl_app.shared.widgets.dialogs import confirm, dialog_buttons, text_window
from dsl_app.shared.widgets.layouts import column_of
from PySide6.QtCore import Qt, QTimer
from PySide6.QtTest import QTest
from PySide6.QtWidgets import (
    QApplication,
    QDialog,
    QDialogButtonBox,
    QLabel,
    QLineEdit,
    QMessageBox,
    QProxyStyle,
    QPushButton,
    QStyle,
    QStyleHintReturn,
    QStyleOption,
    QWidget,
)
from pytestqt.qtbot import QtBot

from tests.app.support.questions import answering_questions


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


def test_a_question_whose_window_goes_is_answered_by_staying(qapp: QApplication) -> None:
    parent = QWidget()
    parent.show()
    # As a dialog does that is deleted when it closes.
    QTimer.singleShot(0, lambda: shiboken6.delete(parent))
    assert not confirm(parent, "Unsaved", "Close it?", "Close unsaved", "Keep editing")


class _WithIcons(QProxyStyle):
    """A desktop whose dialogs have icons on their buttons."""

    def styleHint(
        self,
        hint: QStyle.StyleHint,
        option: QStyleOption | None = None,
        widget: QWidget | None = None,
        returned: QStyleHintReturn | None = None,
    ) -> int:
        if hint == QStyle.StyleHint.SH_DialogButtonBox_ButtonsHaveIcons:
            return 1
        return super().styleHint(hint, option, widget, returned)


def test_tab_goes_through_a_form_and_then_to_its_buttons(qtbot: QtBot) -> None:
    dialog, first, second = QDialog(), QLineEdit(), QLineEdit()
    qtbot.addWidget(dialog)
    buttons = dialog_buttons(QDialogButtonBox.StandardButton.Cancel)
    go = buttons.addButton("Go", QDialogButtonBox.ButtonRole.AcceptRole)
    column_of(first, second, buttons, on=dialog)
    dialog.show()
    qtbot.waitUntil(lambda: dialog.focusWidget() is first)
    QTest.keyClick(first, Qt.Key.Key_Tab)
    assert dialog.focusWidget() is second
    QTest.keyClick(second, Qt.Key.Key_Tab)
    assert dialog.focusWidget() is go
    assert go.isDefault()


@pytest.mark.slow
def test_no_button_of_a_dialog_has_an_icon_of_the_desktop(qtbot: QtBot, qapp: QApplication) -> None:
    before, leave = qapp.style().name(), QDialogButtonBox.StandardButton.Cancel
    qapp.setStyle(_WithIcons())
    try:
        plain, ours = QDialogButtonBox(leave), dialog_buttons(leave)
        qtbot.addWidget(plain)
        qtbot.addWidget(ours)
        assert not plain.button(leave).icon().isNull(), "the desktop has none: nothing is tested"
        assert ours.button(leave).icon().isNull()
    finally:
        qapp.setStyle(before)


def test_what_windows_ask_while_tests_close_them_is_answered(qtbot: QtBot) -> None:
    """Else one that a failed test leaves at work would wait for ever."""
    window = QWidget()
    qtbot.addWidget(window)
    with answering_questions():
        assert confirm(window, "Jobs are running", "Stop?", go="Stop and quit", stay="Keep working")
        assert QDialog(window).exec() == QDialog.DialogCode.Rejected


def test_a_dialog_is_no_larger_than_its_screen(qtbot: QtBot) -> None:
    parent = QWidget()
    qtbot.addWidget(parent)
    window = text_window("Figures", QLabel("text"), parent, 5000, 5000)
    room = window.screen().availableSize()
    assert window.width() < room.width()
    assert window.height() < room.height()
