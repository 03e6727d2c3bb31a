"""Recent files as a list without scroll bars; it is not there while it is empty."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QShowEvent
from PySide6.QtWidgets import QListWidget, QListWidgetItem, QWidget

from dsl_app.shared.paths import there
from dsl_app.shared.plain_tip import plain_tip
from dsl_app.shared.settings import RecentFiles, entry_text
from dsl_app.shared.widgets.forms import label, named
from dsl_app.shared.widgets.layouts import column_of


class RecentList(QWidget):
    """Lists recent files; ``open_path`` opens the one that is chosen. ``filled``: it lists them again."""

    filled = Signal()

    def __init__(
        self,
        recent: RecentFiles,
        open_path: Callable[[Path], object],
        fits: Callable[[Path], bool] = lambda _: True,
    ) -> None:
        """Only files that it ``fits`` are listed."""
        super().__init__()
        self._recent, self._open_path, self._fits = recent, open_path, fits
        self.files = named(QListWidget(), "Recent files", "Double-click or press Enter to open")
        self.files.setVerticalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.files.setTextElideMode(Qt.TextElideMode.ElideMiddle)
        self.files.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.files.itemActivated.connect(self._open)
        self._title = label("Recent", "heading")
        column_of(self._title, self.files, on=self, margins=0)
        self.stops = [recent.paths.follow(lambda _: self.fill())]

    def fill(self) -> None:
        """List the files as they are now."""
        self.files.clear()
        for path in filter(self._fits, self._recent.paths.value):
            item = QListWidgetItem(entry_text(path))
            item.setData(Qt.ItemDataRole.UserRole, str(path))
            item.setToolTip(plain_tip(str(path)))
            if not there(path):
                item.setForeground(self.palette().placeholderText())
            self.files.addItem(item)
        rows = max(self.files.sizeHintForRow(0), 1) * self.files.count()
        self.files.setFixedHeight(rows + 2 * self.files.frameWidth())
        for widget in (self._title, self.files):
            widget.setVisible(self.files.count() > 0)
        self.filled.emit()

    def _open(self, item: QListWidgetItem) -> None:
        self._open_path(Path(item.data(Qt.ItemDataRole.UserRole)))

    def showEvent(self, event: QShowEvent) -> None:
        """Update the list, as files may have come or gone."""
        super().showEvent(event)
        self.fill()
