"""Files dropped on a window."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from PySide6.QtCore import QMimeData, QObject, QTimer


def dropped_paths(data: QMimeData) -> list[Path]:
    """Files and folders of this computer among what is dropped."""
    return [Path(url.toLocalFile()) for url in data.urls() if url.isLocalFile()]


class FilesInTurn(QObject):
    """Opens files one after the other, each once what was opened before it is read."""

    def __init__(
        self, open_path: Callable[[Path], object], is_reading: Callable[[], bool], parent: QObject
    ) -> None:
        super().__init__(parent)
        self._open_path, self._is_reading = open_path, is_reading
        self._waiting: list[Path] = []
        self._is_at_work = False

    def add(self, paths: list[Path]) -> None:
        """Open files once the drop is over, so that its sender does not wait."""
        self._waiting.extend(paths)
        QTimer.singleShot(0, self, self.go_on)

    def go_on(self) -> None:
        """Open what waits as far as nothing is read; called whenever work begins, moves on or ends."""
        if self._is_at_work:
            return  # to open a file begins work itself
        self._is_at_work = True
        try:
            while self._waiting and not self._is_reading():
                self._open_path(self._waiting.pop(0))
        finally:
            self._is_at_work = False
