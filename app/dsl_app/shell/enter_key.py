"""Enter presses what a person would: the button with the focus, else the blue button of the open page."""

from __future__ import annotations

from PySide6.QtCore import Qt
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import (
    QAbstractButton,
    QAbstractItemView,
    QAbstractSpinBox,
    QComboBox,
    QLineEdit,
    QPlainTextEdit,
    QPushButton,
    QTextEdit,
    QToolButton,
    QWidget,
)

#: Here Enter ends what is typed or chosen, which is no wish to start anything.
_ENDS_ENTRY = (QLineEdit, QAbstractSpinBox, QComboBox, QAbstractItemView, QPlainTextEdit, QTextEdit)


def is_enter(event: QKeyEvent) -> bool:
    """Whether Enter was pressed, alone: a key that is held down starts nothing twice."""
    keypad = Qt.KeyboardModifier.KeypadModifier
    is_key = event.key() in (Qt.Key.Key_Return, Qt.Key.Key_Enter)
    return is_key and not event.isAutoRepeat() and not event.modifiers() & ~keypad


def button_of_enter(page: QWidget, focus: QWidget | None) -> QAbstractButton | None:
    """What Enter presses while a widget of the window has the focus; None for nothing.

    On the rail's button of the open page, and on a box to tick, Enter presses the blue button, as it would
    in a dialog.
    """
    if isinstance(focus, _ENDS_ENTRY):
        return None
    if isinstance(focus, QPushButton | QToolButton) and (page.isAncestorOf(focus) or not focus.isChecked()):
        return focus
    blue = [
        each
        for each in page.findChildren(QPushButton)
        if each.isVisible() and each.isEnabled() and each.property("role") == "primary"
    ]
    return blue[0] if len(blue) == 1 else None
