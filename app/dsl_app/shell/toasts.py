"""Messages that appear at the lower right of the window and disappear by themselves."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from PySide6.QtCore import QEvent, QObject, Qt, QTimer, Signal
from PySide6.QtWidgets import QFrame, QMessageBox, QVBoxLayout, QWidget

from dsl_app.shared.notify import Level
from dsl_app.shared.widgets.forms import label, push_button
from dsl_app.shared.widgets.layouts import row_of
from dsl_app.shared.wording import in_window

#: How long a message is shown, ms; an error stays until it is closed.
STAY_MS = {"info": 5000, "warning": 9000}
WIDTH_PX, MARGIN_PX, MOST = 420, 16, 4


class Toast(QFrame):
    """One message with its details and a Close button."""

    dismissed = Signal()

    def __init__(
        self,
        level: Level,
        text: str,
        details: str,
        parent: QWidget,
        offers: Mapping[str, Callable[[], object]] | None = None,
    ) -> None:
        """``offers`` are buttons by their texts; using one closes the toast."""
        super().__init__(parent)
        self.setProperty("role", "toast")
        self.setProperty("level", level)
        self.setAccessibleName(f"{level}: {text}")
        self.level, self.text = level, text
        words = label(text, wraps=True, can_be_copied=True)
        buttons = QVBoxLayout()
        row_of((words, 1), buttons, on=self, margins=(12, 8, 8, 8))
        for name, do in (offers or {}).items():
            offer = push_button(name, text, self.dismiss)
            offer.clicked.connect(lambda _checked=False, do=do: do())
            buttons.addWidget(offer)
        self._add_flat(buttons, "Close", "Close this message", self.dismiss)
        if details:
            self._add_flat(buttons, "Details", "Show details", lambda: self._show(text, details))
        buttons.addStretch(1)

    @staticmethod
    def _add_flat(column: QVBoxLayout, text: str, tip: str, do: Callable[[], object]) -> None:
        button = push_button(text, tip, lambda: do())
        button.setFlat(True)
        column.addWidget(button)

    def dismiss(self) -> None:
        """Close the message."""
        self.hide()
        self.dismissed.emit()
        self.deleteLater()

    def _show(self, text: str, details: str) -> None:
        box = QMessageBox(QMessageBox.Icon.Information, "Details", text, parent=self.window())
        box.setTextFormat(Qt.TextFormat.PlainText)
        box.setDetailedText(details)
        box.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        box.open()


class Toasts(QObject):
    """Shows toasts over a window; a `Notifier`. With more than `MOST`, the oldest is closed."""

    def __init__(self, window: QWidget) -> None:
        super().__init__(window)
        self._window = window
        self._shown: list[Toast] = []
        window.installEventFilter(self)

    @property
    def shown(self) -> tuple[Toast, ...]:
        """The toasts that are shown now."""
        return tuple(self._shown)

    def tell(self, level: Level, text: str, details: str = "") -> None:
        """Show a sentence."""
        self._show(Toast(level, in_window(text), details, self._window), level in STAY_MS)

    def offer(self, text: str, offers: Mapping[str, Callable[[], object]]) -> None:
        """Show a sentence with buttons by their texts; it stays until one is used or it is closed."""
        self._show(Toast("info", text, "", self._window, offers), leaves=False)

    def _show(self, toast: Toast, leaves: bool) -> None:
        if any(other.text == toast.text for other in self._shown):
            toast.deleteLater()
            return
        toast.dismissed.connect(lambda: self._drop(toast))
        self._shown.append(toast)
        for old in tuple(self._shown[:-MOST]):
            old.dismiss()
        if leaves:
            QTimer.singleShot(STAY_MS[toast.level], toast, toast.dismiss)
        toast.show()
        self._settle()

    def _drop(self, toast: Toast) -> None:
        if toast in self._shown:
            self._shown.remove(toast)
            self._settle()

    def _settle(self) -> None:
        """Stack the toasts from the lower right upwards."""
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
