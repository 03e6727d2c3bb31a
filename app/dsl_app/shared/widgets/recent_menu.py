"""The menu of files that were opened last."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from PySide6.QtWidgets import QMenu, QWidget

from dsl_app.shared.recent import RecentFiles


class RecentMenu(QMenu):
    """Filled anew each time it is shown; what vanished is marked, and choosing it says so."""

    def __init__(self, recent: RecentFiles, open_path: Callable[[Path], object], parent: QWidget) -> None:
        super().__init__("Open &recent", parent)
        self._recent, self._open = recent, open_path
        self.setToolTipsVisible(True)
        self.aboutToShow.connect(self.fill)
        self.fill()

    def fill(self) -> None:
        """List the files by number, the latest first."""
        self.clear()
        for i, path in enumerate(self._recent.paths.value, 1):
            # Only the first nine have a key of their own.
            number = f"&{i}  " if i < 10 else f"{i}  "
            action = self.addAction(f"{number}{entry_text(path).replace('&', '&&')}")
            action.setToolTip(str(path))
            action.setStatusTip(str(path))
            action.triggered.connect(lambda _checked=False, path=path: self._open(path))
        if self.isEmpty():
            self.addAction("Nothing was opened yet").setEnabled(False)


def entry_text(path: Path) -> str:
    """How a recent file is named in lists: its name and folder, and whether it is gone."""
    text = f"{path.name}  –  {path.parent}"
    return text if path.exists() else f"{text}  (missing)"
