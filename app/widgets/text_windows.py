"""Windows that only show text: shortcuts, a command line, what the program is."""

from __future__ import annotations

import sys
from collections.abc import Iterable

from PySide6.QtCore import Qt
from PySide6.QtGui import QFontDatabase, QKeySequence
from PySide6.QtWidgets import (
    QApplication,
    QDialog,
    QDialogButtonBox,
    QLabel,
    QPlainTextEdit,
    QPushButton,
    QTextBrowser,
    QVBoxLayout,
    QWidget,
)

from app.actions import Action
from dsl_core import __version__


def _window(title: str, content: QWidget, parent: QWidget, width: int, height: int) -> QDialog:
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


def shortcuts_window(actions: Iterable[Action], parent: QWidget) -> QDialog:
    """Every action with its keys."""
    rows = [
        f"| {action.text.replace('&', '')} | {_keys(action)} | {action.tip} |"
        for action in actions
        if action.shortcut
    ]
    browser = QTextBrowser()
    browser.setAccessibleName("Keyboard shortcuts")
    browser.setToolTip("Every action that has a key")
    browser.setMarkdown("\n".join(["| Action | Keys | What it does |", "|---|---|---|", *rows]))
    return _window("Keyboard shortcuts", browser, parent, 720, 620)


def _keys(action: Action) -> str:
    return QKeySequence(action.shortcut).toString(QKeySequence.SequenceFormat.NativeText)


def command_window(command: str, parent: QWidget) -> QDialog:
    """A command line to copy."""
    text = QPlainTextEdit(command)
    text.setReadOnly(True)
    text.setFont(QFontDatabase.systemFont(QFontDatabase.SystemFont.FixedFont))
    text.setAccessibleName("Command line")
    text.setToolTip("Give this in a terminal to do the same")
    window = _window("Command line", text, parent, 640, 220)
    copy = QPushButton("Copy")
    copy.setToolTip("Copy the command")
    copy.clicked.connect(lambda: QApplication.clipboard().setText(command))
    box = window.findChild(QDialogButtonBox)
    assert isinstance(box, QDialogButtonBox)
    box.addButton(copy, QDialogButtonBox.ButtonRole.ActionRole)
    return window


def about_window(parent: QWidget) -> QDialog:
    """What this is, which version, under which licence."""
    from PySide6 import __version__ as qt_version

    text = QLabel(
        f"<h3>dsl-scan {__version__}</h3>"
        "<p>Hyperspectral 3D scanning by Dispersed Structured Light: an RGB camera, an RGB projector and a"
        " diffraction film.</p>"
        "<p>After S. Shin, S. Choi, F. Heide and S.-H. Baek, <i>Dispersed Structured Light for Hyperspectral"
        " 3D Imaging</i>, CVPR 2024.</p>"
        f"<p>BSD-3-Clause · Python {sys.version.split()[0]} · Qt {qt_version} (LGPL)</p>"
    )
    text.setWordWrap(True)
    text.setAlignment(Qt.AlignmentFlag.AlignTop)
    return _window("About dsl-scan", text, parent, 460, 280)
