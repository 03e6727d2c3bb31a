"""Sentences that appear at the lower right of the window and leave by themselves."""

from __future__ import annotations

from PySide6.QtCore import QEvent, QObject, Qt, QTimer, Signal
from PySide6.QtWidgets import QFrame, QHBoxLayout, QLabel, QMessageBox, QPushButton, QVBoxLayout, QWidget

from app.views import Level

#: How long a sentence stays, ms; an error stays until it is closed.
STAY_MS = {"info": 5000, "warning": 9000}
WIDTH_PX, MARGIN_PX, MOST = 420, 16, 4


class Toast(QFrame):
    """One sentence with its details and a way to close it."""

    dismissed = Signal()

    def __init__(self, level: Level, text: str, details: str, parent: QWidget) -> None:
        super().__init__(parent)
        self.setProperty("role", "toast")
        self.setProperty("level", level)
        self.setAccessibleName(f"{level}: {text}")
        self.level, self.text = level, text
        row = QHBoxLayout(self)
        row.setContentsMargins(12, 8, 8, 8)
        label = QLabel(text)
        label.setWordWrap(True)
        label.setTextFormat(Qt.TextFormat.PlainText)
        label.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        row.addWidget(label, 1)
        buttons = QVBoxLayout()
        row.addLayout(buttons)
        close = QPushButton("Close")
        close.setFlat(True)
        close.clicked.connect(self.dismiss)
        buttons.addWidget(close)
        if details:
            more = QPushButton("Details")
            more.setFlat(True)
            more.clicked.connect(lambda: self._show(text, details))
            buttons.addWidget(more)
        buttons.addStretch(1)

    def dismiss(self) -> None:
        """Leave for good."""
        self.hide()
        self.dismissed.emit()
        self.deleteLater()

    def _show(self, text: str, details: str) -> None:
        box = QMessageBox(QMessageBox.Icon.Information, "Details", text, parent=self.window())
        box.setDetailedText(details)
        box.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        box.open()


class Toasts(QObject):
    """Shows toasts over a window; a `Notifier`. More than `MOST` push the oldest out."""

    def __init__(self, window: QWidget) -> None:
        super().__init__(window)
        self._window = window
        self._shown: list[Toast] = []
        window.installEventFilter(self)

    @property
    def shown(self) -> tuple[Toast, ...]:
        """What is on the window now."""
        return tuple(self._shown)

    def tell(self, level: Level, text: str, details: str = "") -> None:
        """Show a sentence."""
        if any(toast.text == text for toast in self._shown):
            return
        toast = Toast(level, text, details, self._window)
        toast.dismissed.connect(lambda: self._drop(toast))
        self._shown.append(toast)
        for old in tuple(self._shown[:-MOST]):
            old.dismiss()
        if level in STAY_MS:
            QTimer.singleShot(STAY_MS[level], toast, toast.dismiss)
        toast.show()
        self._settle()

    def _drop(self, toast: Toast) -> None:
        if toast in self._shown:
            self._shown.remove(toast)
            self._settle()

    def _settle(self) -> None:
        """Stack what is left from the lower right upwards."""
        bottom = self._window.height() - MARGIN_PX - 24
        for toast in reversed(self._shown):
            toast.setFixedWidth(min(WIDTH_PX, self._window.width() - 2 * MARGIN_PX))
            toast.adjustSize()
            bottom -= toast.height()
            toast.move(self._window.width() - toast.width() - MARGIN_PX, bottom)
            bottom -= 8
            toast.raise_()

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        """Follow the window's size."""
        if watched is self._window and event.type() == QEvent.Type.Resize:
            self._settle()
        return False
