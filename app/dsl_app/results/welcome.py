"""What the page shows in place of a result: what to open, recent files, or a scan to reconstruct."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from PySide6.QtCore import Qt
from PySide6.QtGui import QShowEvent
from PySide6.QtWidgets import QListWidget, QListWidgetItem, QWidget

from dsl_app.shared.settings import RecentFiles, entry_text
from dsl_app.shared.widgets.forms import label, named, push_button
from dsl_app.shared.widgets.layouts import STRETCH, Stretch, column_of, row_of

WIDTH_PX = 560
HINT = (
    "Open a result (a folder NAME.zarr) or a finished scan (NAME.dsl), or drop one on the window. The demo is"
    " a scan of a Color Checker with the simulated rig; making it takes about a minute, the first time only."
)


class Welcome(QWidget):
    """Lists recent files; ``open_path`` opens one, ``demo`` the demo; the button ``choose`` asks for one."""

    def __init__(
        self, recent: RecentFiles, open_path: Callable[[Path], object], demo: Callable[[], object]
    ) -> None:
        super().__init__()
        self._recent, self._open_path = recent, open_path
        tip = "Choose the folder of a result or of a finished scan"
        self.choose = push_button("Open…", tip, role="primary")
        self.demo = push_button("Show the demo", "Open a finished scan of the simulated rig", lambda: demo())
        self.files = named(QListWidget(), "Recent files", "Double-click or press Enter to open")
        self.files.setVerticalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.files.setTextElideMode(Qt.TextElideMode.ElideMiddle)
        self.files.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.files.itemActivated.connect(self._open)
        self._title = label("Recent", "heading")
        hint = label(HINT, "muted", wraps=True)
        buttons = row_of(self.choose, self.demo, STRETCH)
        column_of(label("No result is open", "title"), hint, 6, buttons, 14, self._title, self.files, on=self)
        self.setFixedWidth(WIDTH_PX)
        self.stops = [recent.paths.follow(lambda _: self._fill())]

    def _fill(self) -> None:
        self.files.clear()
        for path in self._recent.paths.value:
            item = QListWidgetItem(entry_text(path))
            item.setData(Qt.ItemDataRole.UserRole, str(path))
            item.setToolTip(str(path))
            if not path.exists():
                item.setForeground(self.palette().placeholderText())
            self.files.addItem(item)
        rows = max(self.files.sizeHintForRow(0), 1) * self.files.count()
        self.files.setFixedHeight(rows + 2 * self.files.frameWidth())
        for widget in (self._title, self.files):
            widget.setVisible(self.files.count() > 0)

    def _open(self, item: QListWidgetItem) -> None:
        self._open_path(Path(item.data(Qt.ItemDataRole.UserRole)))

    def showEvent(self, event: QShowEvent) -> None:
        """Update the list, as files may have come or gone."""
        super().showEvent(event)
        self._fill()


class Offer(QWidget):
    """A message in place of a result, with buttons to reconstruct a scan that has none."""

    def __init__(self) -> None:
        super().__init__()
        self.message = label("", "muted", wraps=True)
        self.message.setAlignment(Qt.AlignmentFlag.AlignCenter)
        tip = "Compute depth and spectra from the frames; the result is saved next to the scan"
        self.reconstruct = push_button("Reconstruct", tip, role="primary")
        self.otherwise = push_button(
            "With other parameters…", "Choose bands, solver, calibration and name first (Ctrl+R)"
        )
        column_of(
            STRETCH,
            self.message,
            8,
            *((button, 0, Qt.AlignmentFlag.AlignHCenter) for button in (self.reconstruct, self.otherwise)),
            Stretch(2),
            on=self,
        )

    def show_offer(self, message: str, can_reconstruct: bool) -> None:
        """Show a message; the buttons only where a scan can be reconstructed."""
        self.message.setText(message)
        for button in (self.reconstruct, self.otherwise):
            button.setVisible(can_reconstruct)
