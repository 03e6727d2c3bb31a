"""A dialog that only shows text, and the one that shows a command line."""

from __future__ import annotations

from PySide6.QtCore import Qt
from PySide6.QtGui import QFontDatabase
from PySide6.QtWidgets import (
    QApplication,
    QDialog,
    QDialogButtonBox,
    QPlainTextEdit,
    QPushButton,
    QVBoxLayout,
    QWidget,
)


def text_window(title: str, content: QWidget, parent: QWidget, width: int, height: int) -> QDialog:
    """A dialog around some content, with a Close button."""
    window = QDialog(parent)
    window.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
    window.setWindowTitle(title)
    window.resize(width, height)
    buttons = QDialogButtonBox(QDialogButtonBox.StandardButton.Close)
    buttons.button(QDialogButtonBox.StandardButton.Close).setToolTip("Close this window (Escape)")
    buttons.rejected.connect(window.reject)
    column = QVBoxLayout(window)
    column.addWidget(content, 1)
    column.addWidget(buttons)
    return window


def command_window(command: str, parent: QWidget) -> QDialog:
    """A command line to copy."""
    text = QPlainTextEdit(command)
    text.setReadOnly(True)
    text.setFont(QFontDatabase.systemFont(QFontDatabase.SystemFont.FixedFont))
    text.setAccessibleName("Command line")
    text.setToolTip("Give this in a terminal to do the same")
    window = text_window("Command line", text, parent, 640, 220)
    copy = QPushButton("Copy")
    copy.setToolTip("Copy the command")
    copy.clicked.connect(lambda: QApplication.clipboard().setText(command))
    box = window.findChild(QDialogButtonBox)
    assert isinstance(box, QDialogButtonBox)
    box.addButton(copy, QDialogButtonBox.ButtonRole.ActionRole)
    return window
