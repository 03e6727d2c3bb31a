"""Windows on the program itself: its shortcuts, and what it is."""

from __future__ import annotations

import sys
from collections.abc import Iterable

from PySide6.QtCore import Qt
from PySide6.QtGui import QKeySequence
from PySide6.QtWidgets import QDialog, QLabel, QTextBrowser, QWidget

from dsl_app.shared.widgets.text_windows import text_window
from dsl_app.shell.actions import Action
from dsl_core import __version__


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
    return text_window("Keyboard shortcuts", browser, parent, 720, 620)


def _keys(action: Action) -> str:
    return QKeySequence(action.shortcut).toString(QKeySequence.SequenceFormat.NativeText)


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
    return text_window("About dsl-scan", text, parent, 460, 280)
