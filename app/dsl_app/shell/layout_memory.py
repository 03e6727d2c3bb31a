"""How a window lay when it was closed, in the settings."""

from __future__ import annotations

from PySide6.QtCore import QByteArray
from PySide6.QtWidgets import QMainWindow

from dsl_app.shared.settings import Settings

#: Rises when docks change, so that a layout of an older version is not restored.
LAYOUT_VERSION = 1


def restore_layout(window: QMainWindow, settings: Settings) -> None:
    """Place window and docks as they lay; Qt leaves them where it cannot make sense of what was kept."""
    window.restoreGeometry(QByteArray.fromBase64(settings.window_geometry.encode()))
    window.restoreState(QByteArray.fromBase64(settings.window_state.encode()), LAYOUT_VERSION)


def keep_layout(window: QMainWindow, settings: Settings) -> None:
    """Note in the settings how window and docks lie."""
    settings.window_geometry = _text(window.saveGeometry())
    settings.window_state = _text(window.saveState(LAYOUT_VERSION))


def _text(kept: QByteArray) -> str:
    return bytes(kept.toBase64().data()).decode()
