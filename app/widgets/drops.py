"""Files dropped on a window."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from PySide6.QtCore import QMimeData, QObject, QTimer


def dropped_paths(data: QMimeData) -> list[Path]:
    """Files and folders of this computer among what is dropped."""
    return [Path(url.toLocalFile()) for url in data.urls() if url.isLocalFile()]


def open_after_drop(paths: list[Path], open_path: Callable[[Path], object], owner: QObject) -> None:
    """Open files one after the other once the drop is over, so that its sender does not wait."""
    for path in paths:
        QTimer.singleShot(0, owner, lambda path=path: open_path(path))
